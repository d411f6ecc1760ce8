// In place of what kernel/generate.c writes of a scene: shapes that a test sets (span_scenes.h).
#pragma once

#define SHAPES 8
#define EACH_PLANE(F) F(0) F(1)
#define EACH_SOLID(F) F(2) F(3) F(4) F(5) F(6) F(7)
#define UNROLLED 1
#define HAS_GROUPS 0
