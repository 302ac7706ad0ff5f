"""The only places that know clingo, SWI-Prolog and child processes."""
