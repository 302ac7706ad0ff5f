"""What every part uses: reading and writing files, where shipped files lie, sets as bits."""
