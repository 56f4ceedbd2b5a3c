"""Controllers and skills that experts share: locomotion, paths, postures, motion of both palms."""
