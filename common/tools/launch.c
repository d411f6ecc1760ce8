// Launches a program once and writes what it took, as a line of JSON, to an open file:
//   launch FD CPUS PROGRAM [ARGUMENT …]      CPUS: "3" or "0,2", where the program may run; "-": anywhere
// The wall time is from right before the fork to the program's end. The rest is wait4's: a program of few pages does
// the launching, since a child's peak memory is never below that of the process that it was forked from.
#include <errno.h>
#include <inttypes.h>
#include <linux/perf_event.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static int64_t nanoseconds(int64_t seconds, int64_t more) {
    return seconds * 1000000000 + more;
}

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC_RAW, &t);
    return nanoseconds(t.tv_sec, t.tv_nsec);
}

// Stays on those CPUs, and so does what it starts. Returns whether that may be.
static int stay_on(const char *cpus) {
    cpu_set_t set;
    CPU_ZERO(&set);
    for (const char *rest = cpus; *rest; rest += *rest == ',') {
        char *end;
        const unsigned long cpu = strtoul(rest, &end, 10);
        if (end == rest || cpu >= CPU_SETSIZE || (*end && *end != ',')) {
            return 0;
        }
        CPU_SET(cpu, &set);
        rest = end;
    }
    return sched_setaffinity(0, sizeof set, &set) == 0;
}

// Returns a counter of instructions in user mode, of this process and what it starts; −1: the machine has none.
static int counter(void) {
    struct perf_event_attr attr = {
        .type = PERF_TYPE_HARDWARE, .size = sizeof attr, .config = PERF_COUNT_HW_INSTRUCTIONS};
    attr.inherit = 1;
    attr.exclude_kernel = 1;
    attr.exclude_hv = 1;
    return (int)syscall(SYS_perf_event_open, &attr, 0, -1, -1, PERF_FLAG_FD_CLOEXEC);
}

static int64_t counted(int fd) {
    int64_t count = -1;
    return fd >= 0 && read(fd, &count, sizeof count) == sizeof count ? count : -1;
}

int main(int argc, char **argv) {
    if (argc < 4) {
        fprintf(stderr, "usage: launch FD CPUS PROGRAM [ARGUMENT ...]\n");
        return 2;
    }
    const int report = atoi(argv[1]);
    if (strcmp(argv[2], "-") != 0 && !stay_on(argv[2])) {
        fprintf(stderr, "launch: CPUs %s: %s\n", argv[2], strerror(errno));
        return 3;
    }
    cpu_set_t may;
    CPU_ZERO(&may);
    const int cpus = sched_getaffinity(0, sizeof may, &may) ? 1 : CPU_COUNT(&may);
    volatile int failed = 0; // the child of vfork writes into this process's memory
    const int instructions = counter();
    const int64_t first = counted(instructions), begin = now();
    const pid_t child = vfork();
    if (child == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        close(report);
        execvp(argv[3], argv + 3);
        failed = errno;
        _exit(127);
    }
    int status = 0;
    struct rusage used = {0};
    if (child < 0 || wait4(child, &status, 0, &used) != child) {
        fprintf(stderr, "launch: %s\n", strerror(errno));
        return 3;
    }
    const int64_t wall = now() - begin, count = counted(instructions) - first;
    if (failed) {
        fprintf(stderr, "%s: %s\n", argv[3], strerror(failed));
        return 127;
    }
    dprintf(report, "{\"exit_status\": %d, \"ns\": %" PRId64,
            WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), wall);
    const int64_t user = nanoseconds(used.ru_utime.tv_sec, used.ru_utime.tv_usec * INT64_C(1000));
    const int64_t system = nanoseconds(used.ru_stime.tv_sec, used.ru_stime.tv_usec * INT64_C(1000));
    dprintf(report,
            ", \"user_ns\": %" PRId64 ", \"system_ns\": %" PRId64 ", \"unused_ns\": %" PRId64, user,
            system, cpus * wall - user - system);
    dprintf(report, ", \"max_rss_kib\": %ld, \"faults_minor\": %ld, \"faults_major\": %ld",
            used.ru_maxrss, used.ru_minflt, used.ru_majflt);
    dprintf(report, ", \"ctx_voluntary\": %ld, \"ctx_involuntary\": %ld", used.ru_nvcsw,
            used.ru_nivcsw);
    if (first >= 0) {
        dprintf(report, ", \"instructions\": %" PRId64, count);
    }
    return dprintf(report, "}\n") < 0;
}
