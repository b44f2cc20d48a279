"""Database migrations (Alembic); `app.database.upgrade` runs them."""

HEAD = "0005"  # the newest revision, so that a start can see whether there is anything to do
