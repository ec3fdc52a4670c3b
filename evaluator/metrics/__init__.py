"""The metrics: scale ratio, errors per sequence, protocols, ranks. Pure arrays; import nothing else here."""
