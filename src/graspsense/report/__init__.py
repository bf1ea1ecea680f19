"""Pages, tables and figures. Everything that graspsense draws is drawn here."""
