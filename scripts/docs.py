"""Build the documentation's site: READMEs, the pages of every docs/, the API from docstrings.

Pages keep their places relative to each other: links mean the same in a checkout and on the site.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"\]\(([^)#\s]+)")
PACKAGES = ("keepaway_sim", "keepaway_agent", "keepaway_transfer")


def main() -> None:
    """Lay the pages out in a temporary folder, and let mkdocs make the site of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "site", help="folder of the site"
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        laid_out = Path(folder) / "pages"
        for page in pages():
            lay_out(page, laid_out)
        api = [write_api(package, laid_out) for package in PACKAGES]
        settings = Path(folder) / "mkdocs.yml"
        settings.write_text(yaml.safe_dump(site(laid_out, arguments.out.resolve(), api)))
        build = ["build", "--strict", "--quiet", "-f", str(settings)]
        done = subprocess.run([sys.executable, "-m", "mkdocs", *build], check=False)
    if done.returncode:
        sys.exit("docs: the site was not built; the wrong page is named above")
    print(f"documentation: {arguments.out / 'index.html'}")


def pages() -> list[Path]:
    """Every page, relative to the checkout: top level, packages' READMEs, their docs."""
    patterns = ("*.md", "msgs/README.md", "src/*/README.md", "src/*/docs/*.md")
    found = {page.relative_to(ROOT) for pattern in patterns for page in ROOT.glob(pattern)}
    return sorted(found)


def lay_out(page: Path, folder: Path) -> None:
    """Copy a page and every file of the checkout that it links to or shows."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for link in LINK.findall(text):
        target = (ROOT / page).parent / link
        if "://" not in link and target.is_file() and target.suffix != ".md":
            copy(target.resolve().relative_to(ROOT), folder)
    place = folder / ("index.md" if page == Path("README.md") else page)
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(LINK.sub(lambda match: on_site(match, page), text), encoding="utf-8")


def on_site(match: re.Match[str], page: Path) -> str:
    """A link as the site has it: a folder means its README, and the top README is the index."""
    link = match[1]
    target = (ROOT / page).parent / link
    if "://" in link or not target.exists():
        return match[0]
    if target.is_dir():
        readme = "README.md" if (target / "README.md").exists() else None
        return f"]({link.rstrip('/')}/{readme}" if readme else match[0]
    is_index = target.resolve() == ROOT / "README.md"
    return f"]({link[: -len('README.md')]}index.md" if is_index else match[0]


def copy(path: Path, folder: Path) -> None:
    """Copy a file of the checkout to the same place below the folder."""
    (folder / path).parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(ROOT / path, folder / path)


def write_api(package: str, folder: Path) -> dict[str, Any]:
    """A page for every module of a package; the package's part of the site's contents."""
    base = ROOT / "src" / package
    contents: list[dict[str, str]] = []
    for module in sorted((base / package).rglob("*.py")):
        name = ".".join(module.relative_to(base).with_suffix("").parts)
        if module.name == "__init__.py" or not module.read_text().strip():
            continue
        page = Path("api") / f"{name}.md"
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        (folder / page).write_text(f"# {name}\n\n::: {name}\n")
        contents.append({name.partition(".")[2]: str(page)})
    return {package: contents}


def site(folder: Path, out: Path, api: list[dict[str, Any]]) -> dict[str, Any]:
    """Mkdocs' settings for the pages in a folder."""
    sources = [str(ROOT / "src" / package) for package in PACKAGES]
    options = {"docstring_style": "google", "show_source": True, "show_root_heading": False}
    handlers = {"python": {"paths": sources, "options": options}}
    laid_out = [page for page in pages() if page != Path("README.md")]
    guides = [page for page in laid_out if "docs" in page.parts]
    others = [page for page in laid_out if "docs" not in page.parts]
    return {
        "site_name": "Keepaway",
        "docs_dir": str(folder),
        "site_dir": str(out),
        "use_directory_urls": False,
        "theme": {"name": "readthedocs"},
        "plugins": ["search", {"mkdocstrings": {"handlers": handlers}}],
        "validation": {"links": {"not_found": "info", "anchors": "info"}},
        "nav": [
            {"Keepaway": "index.md"},
            {"Guides": [{title(page): str(page)} for page in guides]},
            {"Packages": [{title(page): str(page)} for page in others]},
            {"API": api},
        ],
    }


def title(page: Path) -> str:
    """A page's heading."""
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    return next((line[2:] for line in lines if line.startswith("# ")), page.stem)


if __name__ == "__main__":
    main()
