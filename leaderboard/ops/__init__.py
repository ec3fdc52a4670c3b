"""Operations: health, Prometheus, logging, rate limits, the broker.

Every room may import this one.
"""
