// Colours from three vectors (red, green, blue; a pixel a lane) to a picture of interleaved floats: 8 and 16 lanes.
//
//   v_store_or_stream(to, stream, a)   stores a; stream: past the caches, `to` aligned to a vector
//   v_store_block(rgb, stride, r, g, b)  a block of 4 x LANES/4 pixels, its rows `stride` floats apart
//   v_load_block_row(from)             one row of neighbouring blocks that were stored one behind the other
//   v_store_row(rgb, stream, r, g, b)  LANES pixels of a row
#ifndef SIMD_RGB_H
#define SIMD_RGB_H

#include "simd/simd.h"

#if LANES == 16
#include "simd/rgb16.h"
#elif LANES == 8
#include "simd/rgb8.h"
#endif

#endif
