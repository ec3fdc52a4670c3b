"""The pages that maintainers write: rules, contact, privacy, imprint, licence."""
