// What the operating system says of this process and machine.
#include <sched.h>
#include <stdio.h>
#include <sys/resource.h>

#include "driver/driver.h"

// VmHWM, of this program alone: getrusage's ru_maxrss outlives exec, so that it is the parent's where a script with
// more memory than the render has started it. 0: not told.
static long peak_rss_kib(void) {
    long kib = 0;
    char line[256];
    FILE *status = fopen("/proc/self/status", "r");
    while (status && fgets(line, sizeof line, status))
        if (sscanf(line, "VmHWM: %ld kB", &kib) == 1)
            break;
    if (status)
        fclose(status);
    return kib;
}

struct conditions driver_conditions(void) {
    struct conditions now = {0};
    FILE *stat = fopen("/proc/stat", "r");
    if (stat) { // user nice system idle iowait irq softirq steal
        if (fscanf(stat, "cpu %*d %*d %*d %*d %*d %*d %*d %ld", &now.steal_ticks) != 1)
            now.steal_ticks = 0;
        fclose(stat);
    }
    struct rusage usage;
    if (getrusage(RUSAGE_SELF, &usage) == 0) {
        now.ctx_voluntary = usage.ru_nvcsw;
        now.ctx_involuntary = usage.ru_nivcsw;
        now.faults_minor = usage.ru_minflt;
        now.faults_major = usage.ru_majflt;
    }
    now.max_rss_kib = peak_rss_kib();
    return now;
}

int driver_cpu(void) {
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) != 0 || CPU_COUNT(&set) != 1)
        return -1;
    for (int cpu = 0; cpu < CPU_SETSIZE; cpu++)
        if (CPU_ISSET(cpu, &set))
            return cpu;
    return -1;
}
