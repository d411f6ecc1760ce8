// Counters of the operating system for this process and machine.
#include <stdio.h>
#include <sys/resource.h>

#include "driver/driver.h"
#include "workers/cpus.h"

// Peak resident memory (VmHWM) in KiB, 0 if unknown. getrusage's ru_maxrss would not do: it survives
// exec, so under a script that uses more memory than the renderer it is the script's peak.
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
    struct cpus cpus = {0};
    int found = -1;
    if (cpus_get(&cpus) == 0 && CPU_COUNT_S(cpus.size, cpus.set) == 1)
        for (int cpu = 0; cpu < cpus_end(&cpus); cpu++)
            if (CPU_ISSET_S((size_t)cpu, cpus.size, cpus.set))
                found = cpu;
    cpus_free(&cpus);
    return found;
}
