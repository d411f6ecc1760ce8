// The kernel's source, embedded in the program (embedded.h, by common/build/phase_info.py from phase.json's
// "embedded"), so that no source tree is needed at run time.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "embedded.h"
#include "kernel/kernel.h"

char *kernel_source(const char *scene_text) {
    char *text = NULL;
    size_t size = 0;
    FILE *to = open_memstream(&text, &size);
    if (!to)
        return NULL;
    for (size_t i = 0; i < sizeof embedded_lines / sizeof *embedded_lines; i++)
        fputs(strstr(embedded_lines[i], "\"scene_kernel.h\"") ? scene_text : embedded_lines[i], to);
    bool sound = !ferror(to);
    if (fclose(to) != 0 || !sound) {
        free(text);
        return NULL;
    }
    return text;
}
