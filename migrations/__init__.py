"""Database migrations (Alembic); `app.database.upgrade` runs them."""
