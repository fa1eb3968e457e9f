# Lets pip build this package against the ros-jazzy-* wheels of its environment. An ordinary ROS 2 does not read it:
# pyproject.toml hands it to CMake as CMAKE_PROJECT_INCLUDE.

find_package(Python3 REQUIRED COMPONENTS Interpreter)

# The wheels' prefix is four folders above PREFIX/lib/pythonX.Y/site-packages/ament_package/__init__.py's own.
execute_process(
  COMMAND "${Python3_EXECUTABLE}" -c
    "import ament_package, pathlib; print(pathlib.Path(ament_package.__file__).absolute().parents[4].as_posix())"
  OUTPUT_VARIABLE wheel_prefix
  OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY
)
list(PREPEND CMAKE_PREFIX_PATH "${wheel_prefix}")
set(ENV{AMENT_PREFIX_PATH} "${wheel_prefix}:$ENV{AMENT_PREFIX_PATH}")
set(ENV{CMAKE_PREFIX_PATH} "${wheel_prefix}:$ENV{CMAKE_PREFIX_PATH}")

# The wheels' targets name include folders of the machine that they were built on; CMake refuses missing ones.
function(remove_missing_include_directories)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(directories ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(directories)
      list(FILTER directories EXCLUDE REGEX "^/opt/(python|_internal)/")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${directories}")
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL remove_missing_include_directories)
