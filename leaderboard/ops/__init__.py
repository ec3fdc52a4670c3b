"""Operations: health, Prometheus, logging, rate limits, the broker."""
