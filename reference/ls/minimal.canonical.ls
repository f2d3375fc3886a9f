/PROG  A
/MN
/POS
/END
