"""The REST API, in the words of Django REST Framework: each view calls one domain function."""
