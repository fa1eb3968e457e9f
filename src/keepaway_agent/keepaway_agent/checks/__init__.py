"""Does an agent keep to the contract, and would it decide the same again?"""
