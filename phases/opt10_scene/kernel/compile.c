// Runs the system's compiler: found on PATH, without a shell, with a time limit.
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "kernel/kernel.h"
#include "phase_info.h"

extern char **environ;

enum { MAX_ARGUMENTS = 64, SECONDS = 60 };

static bool is_program(const char *path) {
    struct stat found;
    return stat(path, &found) == 0 && S_ISREG(found.st_mode) && access(path, X_OK) == 0;
}

static bool on_path(const char *name, char path[4096]) {
    size_t name_length = strlen(name);
    if (strchr(name, '/')) {
        if (name_length < 4096)
            memcpy(path, name, name_length + 1);
        return name_length < 4096 && is_program(path);
    }
    const char *at = getenv("PATH");
    while (at && *at) {
        size_t length = strcspn(at, ":");
        if (length > 0 && length + name_length + 2 <= 4096) {
            memcpy(path, at, length);
            path[length] = '/';
            memcpy(path + length + 1, name, name_length + 1);
            if (is_program(path))
                return true;
        }
        at += length + (at[length] == ':');
    }
    return false;
}

// Splits a compiler of several words, as `ccache gcc`; blanks of a program's path are its own. Returns their number.
static int words_of(char *compiler, char *words[], int most) {
    int count = 0;
    if (is_program(compiler))
        words[count++] = compiler;
    else
        for (char *word = strtok(compiler, " "); word && count < most; word = strtok(NULL, " "))
            words[count++] = word;
    return count;
}

// Sets `path` to a program's path, or to a command whose first word is a program. False: there is none.
static bool command_on_path(const char *command, char path[4096]) {
    char name[4096];
    if (on_path(command, path))
        return true;
    snprintf(name, sizeof name, "%.*s", (int)strcspn(command, " "), command);
    bool found = on_path(name, path);
    return snprintf(path, 4096, "%s", command) < 4096 && found;
}

void identify_compiler(const char *compiler, char text[8192]) {
    char command[4096], path[4096], whole[4096], *words[MAX_ARGUMENTS], *end = text + 8192;
    struct stat file;
    int count = words_of(memcpy(command, compiler, strlen(compiler) + 1), words, MAX_ARGUMENTS);
    *text = '\0';
    for (int i = 0; i < count; i++, text += strlen(text))
        if (on_path(words[i], path) && realpath(path, whole) && stat(whole, &file) == 0)
            snprintf(text, (size_t)(end - text), "%s%s: %lld bytes of %lld.%09ld, inode %lld",
                     i ? "; " : "", whole, (long long)file.st_size, (long long)file.st_mtim.tv_sec,
                     file.st_mtim.tv_nsec, (long long)file.st_ino);
        else
            snprintf(text, (size_t)(end - text), "%s%s", i ? "; " : "", words[i]);
}

void find_compiler(char path[4096], char reason[256]) {
    const char *chosen = getenv("STEPWISE_CC"), *cc = getenv("CC");
    *reason = '\0';
    if (chosen && *chosen) {
        if (strcmp(chosen, "none") == 0)
            snprintf(reason, 256, "STEPWISE_CC is none");
        else if (!command_on_path(chosen, path))
            snprintf(reason, 256, "there is no compiler %.120s (STEPWISE_CC)", chosen);
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
    } else {
        snprintf(reason, 256, "a sanitizer is in use, and STEPWISE_CC does not name its compiler");
    }
    (void)cc;
#else
    } else if (!command_on_path(PHASE_CC, path) && !(cc && command_on_path(cc, path)) &&
               !on_path("cc", path) && !on_path("gcc", path) && !on_path("clang", path))
        snprintf(reason, 256, "there is no compiler cc, gcc or clang on PATH");
#endif
    if (*reason)
        *path = '\0';
}

// Returns the limit in seconds, 0 if STEPWISE_CC_SECONDS is no positive number.
static double time_limit(void) {
    const char *limit = getenv("STEPWISE_CC_SECONDS");
    char *end;
    double seconds = limit && *limit ? strtod(limit, &end) : SECONDS;
    return limit && *limit && (*end || !(seconds > 0)) ? 0 : seconds;
}

// Signals while the compiler runs in its own process group. A signal that ends this process ends the compiler
// too.
static const int signals[] = {SIGINT, SIGTERM, SIGHUP};
enum { SIGNALS = sizeof signals / sizeof *signals };
static volatile sig_atomic_t interrupted;

static void interrupt(int number) {
    interrupted = number;
}

static void watch_signals(struct sigaction before[SIGNALS]) {
    interrupted = 0;
    for (int i = 0; i < SIGNALS; i++) {
        struct sigaction now = {.sa_handler = interrupt};
        sigaction(signals[i], NULL, &before[i]);
        if (before[i].sa_handler != SIG_IGN) // nohup stays nohup
            sigaction(signals[i], &now, NULL);
    }
}

static void restore_signals(const struct sigaction before[SIGNALS]) {
    for (int i = 0; i < SIGNALS; i++)
        sigaction(signals[i], &before[i], NULL);
}

// Waits for the process. Returns false if it takes longer than `seconds` and was killed.
static bool wait_for(pid_t pid, int *status, double seconds) {
    struct timespec pause = {0, 2000000}, begin, now;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (;;) {
        pid_t ended = waitpid(pid, status, WNOHANG);
        if (ended == pid || (ended < 0 && errno != EINTR))
            return ended == pid;
        clock_gettime(CLOCK_MONOTONIC, &now);
        if (interrupted ||
            !((double)(now.tv_sec - begin.tv_sec) + (double)(now.tv_nsec - begin.tv_nsec) * 1e-9 <
              seconds)) {
            kill(-pid, SIGKILL); // its own group: the compiler driver's children too
            waitpid(pid, status, 0);
            return false;
        }
        nanosleep(&pause, NULL);
    }
}

// Sets text to the first line of the compiler's output that names an error, else to its first line.
static void first_error(const char *log, char text[128]) {
    FILE *file = fopen(log, "r");
    char line[512];
    *text = '\0';
    while (file && fgets(line, sizeof line, file)) {
        line[strcspn(line, "\n")] = '\0';
        const char *error = strstr(line, "error");
        if (error || (!*text && line[strspn(line, " \t")]))
            snprintf(text, 128, ": %.120s", error ? error : line);
        if (error)
            break;
    }
    char *to = text; // characters that are not ASCII, mostly quotation marks, become '
    for (const char *c = text; *c; c++)
        if ((*c & 0xc0) != 0x80)
            *to++ = (char)(*c & 0x80 ? '\'' : *c < ' ' ? ' ' : *c);
    *to = '\0';
    if (file)
        fclose(file);
}

static int spawn(char **arguments, const char *log, pid_t *pid) {
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    int error = posix_spawn_file_actions_init(&files);
    if (error)
        return error;
    error = posix_spawnattr_init(&attributes);
    if (!error) {
        posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
        posix_spawn_file_actions_addopen(&files, 1, log, O_WRONLY | O_CREAT | O_TRUNC, 0600);
        posix_spawn_file_actions_adddup2(&files, 1, 2);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
        posix_spawnattr_setpgroup(&attributes, 0);
        error = posix_spawnp(pid, arguments[0], &files, &attributes, arguments, environ);
        posix_spawnattr_destroy(&attributes);
    }
    posix_spawn_file_actions_destroy(&files);
    return error;
}

static bool compile(const char *compiler, const char *flags, int lanes, const char *tag,
                    const char *source_path, const char *object_path, char reason[256]) {
    char lanes_is[32], tag_is[64], words[2048], log[4096], command[4096];
    char *arguments[MAX_ARGUMENTS] = {NULL};
    snprintf(command, sizeof command, "%s", compiler);
    int count = words_of(command, arguments, MAX_ARGUMENTS / 2);
    snprintf(lanes_is, sizeof lanes_is, "-DLANES=%d", lanes);
    snprintf(tag_is, sizeof tag_is, "-DKERNEL_TAG=\"%s\"", tag);
    snprintf(log, sizeof log, "%s.log", source_path);
    if (snprintf(words, sizeof words,
                 "-std=c11 -D_GNU_SOURCE -w -fPIC -shared -fvisibility=default %s",
                 flags) >= (int)sizeof words) {
        snprintf(reason, 256, "the flags are too long");
        return false;
    }
    char *rest[] = {lanes_is, tag_is, (char *)source_path, "-o", (char *)object_path, "-lm"};
    enum { REST = sizeof rest / sizeof *rest };
    for (char *word = strtok(words, " "); word; word = strtok(NULL, " ")) {
        if (count + REST + 1 == MAX_ARGUMENTS) { // the last one is NULL
            snprintf(reason, 256, "the flags are too many");
            return false;
        }
        arguments[count++] = word;
    }
    for (size_t i = 0; i < REST; i++)
        arguments[count++] = rest[i];
    pid_t pid;
    double seconds = time_limit();
    if (seconds == 0) {
        snprintf(reason, 256, "STEPWISE_CC_SECONDS is %.60s: a number above 0 is required",
                 getenv("STEPWISE_CC_SECONDS"));
        return false;
    }
    struct sigaction before[SIGNALS];
    watch_signals(before);
    int status = 0, error = spawn(arguments, log, &pid);
    bool in_time = !error && wait_for(pid, &status, seconds);
    restore_signals(before);
    if (interrupted) { // ends this process, without leaving files
        const char *left[] = {log, source_path, object_path};
        for (size_t i = 0; i < sizeof left / sizeof *left; i++)
            unlink(left[i]);
        raise(interrupted);
    }
    char said[128] = "";
    if (error)
        snprintf(reason, 256, "%.80s cannot be run: %s", compiler, strerror(error));
    else if (!in_time)
        snprintf(reason, 256, "%.80s took longer than its time limit, %g s", compiler, seconds);
    else if (WIFSIGNALED(status))
        snprintf(reason, 256, "%.80s was killed: %.60s", compiler, strsignal(WTERMSIG(status)));
    else if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        first_error(log, said);
        snprintf(reason, 256, "%.80s failed%s", compiler, said);
    } else
        *reason = '\0';
    unlink(log);
    return *reason == '\0';
}

// Flags of gcc 12 and later: how to copy structs.
static const char *const copies[] = {
    "-mmove-max=", "-mstore-max=", "-mmemcpy-strategy=", "-mmemset-strategy="};
enum { COPIES = sizeof copies / sizeof *copies };

// Sets `fewer` to the flags without these. Returns whether the compiler complained about one of them.
static bool fewer_flags(const char *flags, const char *reason, char fewer[2048]) {
    bool complained = false;
    for (int i = 0; i < COPIES; i++)
        complained |= strstr(reason, copies[i]) != NULL;
    size_t count = 0;
    for (size_t length; complained && *flags; flags += length + (flags[length] == ' ')) {
        bool copy = false;
        length = strcspn(flags, " ");
        for (int i = 0; i < COPIES; i++)
            copy |= strncmp(flags, copies[i], strlen(copies[i])) == 0;
        if (copy)
            continue;
        memcpy(fewer + count, flags, length);
        count += length;
        fewer[count++] = ' ';
    }
    fewer[count] = '\0';
    return complained;
}

bool compile_kernel(const char *compiler, const char *flags, int lanes, const char *tag,
                    const char *source_path, const char *object_path, char reason[256]) {
    char fewer[2048];
    return compile(compiler, flags, lanes, tag, source_path, object_path, reason) ||
           (strlen(flags) < sizeof fewer - 1 && fewer_flags(flags, reason, fewer) &&
            compile(compiler, fewer, lanes, tag, source_path, object_path, reason));
}
