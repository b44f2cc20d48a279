"""Database migrations (Alembic); `app.database.upgrade` runs them."""

HEAD = "0005"  # the newest revision, told here so that a start can see that there is nothing to do
