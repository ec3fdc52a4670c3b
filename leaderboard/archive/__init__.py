"""Archives: the public results in a folder that can be read without the site.

The command `archive` imports this room; it reads what exports and the API show everybody.
"""
