"""Archives: what exports and the API show everybody, in a folder that can be read without the site."""
