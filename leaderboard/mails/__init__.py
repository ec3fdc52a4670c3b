"""Mails that may fail: sent at once or kept and sent later, and notices that people can switch off."""
