"""The landing page, and what crawlers ask for: robots.txt, the sitemap, the icon."""
