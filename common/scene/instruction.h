// A group as a program (scene/group_compile.h). Included by a header of opt2 to opt4: struct primitive is its.
#pragma once

// A step of a group's program.
enum opcode { TO_FRAME, TWIST, LEAF, FOLD, MODIFY };

enum { INSTRUCTIONS_PER_NODE = 4 }; // at most

struct instruction {
    enum opcode opcode;
    int frame;                  // whose point it reads; TO_FRAME and TWIST write the next one
    struct primitive primitive; // TO_FRAME: transform; LEAF: sizes too
    const struct node *node;
};
