// A bitmap font of 5 x 7 for ASCII.
#pragma once

enum { FONT_LINE = 10 }; // height of a line

// Returns a column, 0 to 4, of a character: bit 0 is the top row, bit 7 is below the base line.
unsigned font_column(char character, int column);
