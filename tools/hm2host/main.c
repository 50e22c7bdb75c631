/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2host: run HAL files and HAL components without LinuxCNC. */
#include <errno.h>
#include <getopt.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "halhost.h"
#include "prompt.h"
#include "session.h"

enum {
    EXIT_HAL = 1,   /* an error in a HAL file */
    EXIT_USAGE = 2, /* an error in the command line */
    EXIT_HUNG = 3,  /* a component's function does not return */
    ITEMS_MAX = 256,
    FOLDERS_MAX = 32,
    IMPATIENT = 3, /* signals that nobody has looked at before the program ends at once */
};

/* Where LinuxCNC's own packages put component modules. */
#define LINUXCNC_MODULES "/usr/lib/linuxcnc/modules"

/* ---- signals ---------------------------------------------------------------------------------------------------- */

static volatile sig_atomic_t pending_signal, signals_seen;

static void on_signal(const int number)
{
    pending_signal = number;
    if (++signals_seen >= IMPATIENT)
        _exit(128 + number);
}

static void catch_signals(void)
{
    struct sigaction action = {.sa_handler = on_signal};
    (void)sigemptyset(&action.sa_mask);
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGHUP, &action, NULL);
    (void)signal(SIGPIPE, SIG_IGN);
}

/* The last signal that ended something, for the exit status. */
static int taken_signal;

static enum hal_wait wait_until(void *const context, const int64_t until_ns)
{
    (void)context;
    const struct timespec until = {.tv_sec = (time_t)(until_ns / 1000000000), .tv_nsec = (long)(until_ns % 1000000000)};
    while (until_ns && !pending_signal && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
    }
    if (!pending_signal)
        return HAL_WAIT_REACHED;
    taken_signal = pending_signal;
    /* Within `run` an interruption ends that command only; elsewhere (until_ns 0) it ends the file. */
    pending_signal = 0;
    signals_seen = 0;
    return taken_signal == SIGINT ? HAL_WAIT_INTERRUPTED : HAL_WAIT_TERMINATED;
}

/* ---- output ----------------------------------------------------------------------------------------------------- */

static void on_output(void *const context, const char *const text, const size_t length)
{
    (void)context;
    (void)fwrite(text, 1, length, stdout);
}

static const char *on_environment(void *const context, const char *const name)
{
    (void)context;
    return getenv(name);
}

/* ---- command line ----------------------------------------------------------------------------------------------- */

enum option_code {
    OPTION_FILE = 'f',
    OPTION_INTERACTIVE = 'i',
    OPTION_EXECUTE = 'e',
    OPTION_HELP = 'h',
    OPTION_VERSION = 'V',
    OPTION_INI = 256,
    OPTION_COMPONENTS,
    OPTION_JSON,
    OPTION_RUN,
    OPTION_NO_REALTIME,
    OPTION_CPU,
    OPTION_TIMING,
    OPTION_HISTOGRAM,
};

static const struct {
    struct option option;
    const char *argument, *help;
} options[] = {
    {{"interactive", no_argument, NULL, OPTION_INTERACTIVE}, "", "prompt for commands (after the files)"},
    {{"file", required_argument, NULL, OPTION_FILE}, "FILE", "execute a file, like a FILE without an option"},
    {{"execute", required_argument, NULL, OPTION_EXECUTE}, "COMMAND", "execute one command, in order with the files"},
    {{"ini", required_argument, NULL, OPTION_INI}, "FILE", "values for [SECTION]NAME in HAL files"},
    {{"components", required_argument, NULL, OPTION_COMPONENTS}, "DIR", "look for components there first"},
    {{"run", required_argument, NULL, OPTION_RUN}, "SECONDS", "after the files: start the threads and let them run"},
    {{"json", no_argument, NULL, OPTION_JSON}, "", "show prints JSON"},
    {{"timing", no_argument, NULL, OPTION_TIMING}, "", "at the end print the threads' run times"},
    {{"histogram", required_argument, NULL, OPTION_HISTOGRAM}, "FILE", "at the end write their histograms as CSV"},
    {{"cpu", required_argument, NULL, OPTION_CPU}, "N|any", "processor for the threads"},
    {{"no-realtime", no_argument, NULL, OPTION_NO_REALTIME}, "", "do not ask for realtime priority"},
    {{"help", no_argument, NULL, OPTION_HELP}, "", "this text"},
    {{"version", no_argument, NULL, OPTION_VERSION}, "", "version of the program"},
};

enum { OPTIONS = sizeof options / sizeof options[0] };

enum item_kind { ITEM_FILE, ITEM_COMMAND };

struct arguments {
    struct {
        enum item_kind kind;
        const char *text;
    } items[ITEMS_MAX];
    size_t item_count;
    const char *folders[FOLDERS_MAX + 4];
    size_t folder_count;
    const char *ini, *run, *histogram;
    bool interactive, json, timing, no_realtime;
    int cpu;
};

static void print_help(void)
{
    printf("Usage: hm2host [OPTION...] [FILE.hal...]\n"
           "Execute HAL files with components and realtime threads in this process.\n"
           "Without a file: a prompt on a terminal, else commands from standard input.\n\n");
    for (size_t i = 0; i < OPTIONS; i++) {
        const struct option *const option = &options[i].option;
        char name[64];
        (void)snprintf(name, sizeof name, "--%s %s", option->name, options[i].argument);
        if (option->val < 256)
            printf("  -%c, %-22s %s\n", option->val, name, options[i].help);
        else
            printf("      %-22s %s\n", name, options[i].help);
    }
    printf("\nExit status: 0 done, 1 error in a HAL file, 2 wrong option, 3 a component hangs, 128+n by signal n.\n");
}

static int add_item(struct arguments *const arguments, const enum item_kind kind, const char *const text)
{
    if (arguments->item_count == ITEMS_MAX) {
        fprintf(stderr, "hm2host: more than %d files and commands\n", ITEMS_MAX);
        return EXIT_USAGE;
    }
    arguments->items[arguments->item_count].kind = kind;
    arguments->items[arguments->item_count++].text = text;
    return 0;
}

static int set_cpu(struct arguments *const arguments, const char *const text)
{
    char *end;
    const long cpu = strtol(text, &end, 10);
    const bool any = strcmp(text, "any") == 0;
    if (!any && (end == text || *end || cpu < 0 || cpu >= sysconf(_SC_NPROCESSORS_CONF))) {
        fprintf(stderr, "hm2host: '%s' is not a processor of this machine\n", text);
        return EXIT_USAGE;
    }
    arguments->cpu = any ? HALHOST_CPU_ANY : (int)cpu;
    return 0;
}

static int add_folder(struct arguments *const arguments, const char *const path)
{
    if (arguments->folder_count == FOLDERS_MAX) {
        fprintf(stderr, "hm2host: more than %d folders of components\n", FOLDERS_MAX);
        return EXIT_USAGE;
    }
    arguments->folders[arguments->folder_count++] = path;
    return 0;
}

/* 0, or -1 to end successfully, or an exit status. */
static int apply(struct arguments *const arguments, const int option)
{
    switch (option) {
    case 1: /* getopt's "-" in front of the short options: a FILE */
    case OPTION_FILE:
        return add_item(arguments, ITEM_FILE, optarg);
    case OPTION_EXECUTE:
        return add_item(arguments, ITEM_COMMAND, optarg);
    case OPTION_COMPONENTS:
        return add_folder(arguments, optarg);
    case OPTION_CPU:
        return set_cpu(arguments, optarg);
    case OPTION_INTERACTIVE:
        arguments->interactive = true;
        return 0;
    case OPTION_INI:
        arguments->ini = optarg;
        return 0;
    case OPTION_RUN:
        arguments->run = optarg;
        return 0;
    case OPTION_HISTOGRAM:
        arguments->histogram = optarg;
        return 0;
    case OPTION_JSON:
        arguments->json = true;
        return 0;
    case OPTION_TIMING:
        arguments->timing = true;
        return 0;
    case OPTION_NO_REALTIME:
        arguments->no_realtime = true;
        return 0;
    case OPTION_HELP:
        print_help();
        return -1;
    case OPTION_VERSION:
        printf("hm2host %s\n", HM2_VERSION);
        return -1;
    default:
        fprintf(stderr, "hm2host --help lists the options\n");
        return EXIT_USAGE;
    }
}

static int parse(struct arguments *const arguments, const int argc, char *const argv[])
{
    struct option long_options[OPTIONS + 1] = {{0}};
    for (size_t i = 0; i < OPTIONS; i++)
        long_options[i] = options[i].option;
    int option, status = 0;
    while (!status && (option = getopt_long(argc, argv, "-if:e:hV", long_options, NULL)) != -1)
        status = apply(arguments, option);
    for (int i = optind; i < argc && !status; i++) /* after "--" */
        status = add_item(arguments, ITEM_FILE, argv[i]);
    return status;
}

/* Folders where components are, after those of the command line: next to the program, installed, LinuxCNC's. */
static void add_default_folders(struct arguments *const arguments, char own[PATH_MAX + 16])
{
    const ssize_t length = readlink("/proc/self/exe", own, PATH_MAX);
    own[length > 0 ? length : 0] = '\0';
    char *const slash = strrchr(own, '/');
    if (slash) {
        memcpy(slash, "/components", sizeof "/components");
        arguments->folders[arguments->folder_count++] = own;
    }
    arguments->folders[arguments->folder_count++] = HM2_COMPONENT_DIR;
    arguments->folders[arguments->folder_count++] = LINUXCNC_MODULES;
    arguments->folders[arguments->folder_count] = NULL;
}

/* With --json, standard output is for JSON only. */
static void on_message(const void *const context, const enum halhost_stream stream, const char *const text)
{
    const struct arguments *const arguments = context;
    FILE *const file = stream == HALHOST_STDOUT && !arguments->json ? stdout : stderr;
    (void)fputs(text, file);
    (void)fflush(file);
}

/* ---- running ---------------------------------------------------------------------------------------------------- */

static int run_text(struct hal_session *const session, const char *const name, const char *const text,
                    struct hm2_diag *const diag)
{
    return hal_session_run_text(session, name, text, strlen(text), diag);
}

/* Read one command with the lines that continue it into text; 0 = end of input. */
static unsigned read_command(struct prompt *const prompt, char *const text, const size_t size)
{
    size_t used = 0;
    unsigned lines = 0;
    const char *line;
    bool more = true;
    while (more && (line = prompt_read(prompt))) {
        const size_t length = strlen(line);
        more = length > 0 && line[length - 1] == '\\';
        lines++;
        const int added = snprintf(text + used, size - used, "%s\n", line);
        used += added > 0 && (size_t)added < size - used ? (size_t)added : size - used - 1;
    }
    return lines;
}

/* Commands from a person or a pipe. At a prompt an error ends nothing. */
static int run_prompt(struct hal_session *const session, const bool keep_going)
{
    static char text[65536];
    struct prompt *const prompt = prompt_new(session);
    int status = prompt ? 0 : EXIT_HAL;
    unsigned number = 1, lines;
    while (!status && !hal_session_ended(session) && (lines = read_command(prompt, text, sizeof text))) {
        struct hm2_diag diag = {0};
        if (keep_going && pending_signal == SIGINT)
            pending_signal = signals_seen = 0;
        const int err = hal_session_run_lines(session, "<stdin>", number, text, strlen(text), &diag);
        number += lines;
        (void)fflush(stdout);
        if (err)
            fputs(diag.text, stderr);
        if (err && (!keep_going || taken_signal == SIGTERM))
            status = EXIT_HAL;
    }
    prompt_free(prompt);
    return status;
}

static int run_items(struct hal_session *const session, const struct arguments *const arguments,
                     struct hm2_diag *const diag)
{
    int err = arguments->ini ? hal_session_read_ini(session, arguments->ini, diag) : 0;
    for (size_t i = 0; i < arguments->item_count && !err && !hal_session_ended(session); i++) {
        const char *const text = arguments->items[i].text;
        err = arguments->items[i].kind == ITEM_FILE ? hal_session_run_file(session, text, diag)
                                                    : run_text(session, "<command line>", text, diag);
    }
    if (!err && arguments->run) {
        char command[64];
        (void)snprintf(command, sizeof command, "run %s", arguments->run);
        err = run_text(session, "<command line>", "start", diag);
        if (!err)
            err = run_text(session, "<command line>", command, diag);
    }
    return err;
}

static int write_histograms(struct hal_session *const session, const char *const path)
{
    char command[PATH_MAX + 32];
    struct hm2_diag diag = {0};
    (void)snprintf(command, sizeof command, "histogram all \"%s\"", path);
    const int err = run_text(session, "<command line>", command, &diag);
    if (err)
        fputs(diag.text, stderr);
    return err ? EXIT_HAL : 0;
}

static int run_session(struct hal_session *const session, const struct arguments *const arguments)
{
    struct hm2_diag diag = {0};
    int status = run_items(session, arguments, &diag) ? EXIT_HAL : 0;
    (void)fflush(stdout);
    fputs(diag.text, stderr);
    const bool terminal = isatty(STDIN_FILENO) != 0;
    if (!status && (arguments->interactive || (arguments->item_count == 0 && !arguments->run)))
        status = run_prompt(session, arguments->interactive || terminal);
    if (halhost_stop(&diag))
        status = EXIT_HUNG;
    if (arguments->timing)
        hal_session_print_timing(session);
    if (arguments->histogram && !status)
        status = write_histograms(session, arguments->histogram);
    return status;
}

static int run_host(const struct arguments *const arguments)
{
    const struct halhost_options host = {
        .message = on_message,
        .context = arguments,
        .folders = arguments->folders,
        .cpu = arguments->cpu,
        .no_realtime = arguments->no_realtime,
    };
    const struct hal_session_options session_options = {
        .write = on_output,
        .environment = on_environment,
        .wait = wait_until,
        .files = true,
        .threads = true,
        .json = arguments->json,
    };
    struct hm2_diag diag = {0};
    struct hal_session *const session = hal_session_new(&session_options);
    int status = !session || halhost_open(&host, &diag) ? EXIT_HAL : 0;
    if (!status)
        status = run_session(session, arguments);
    const bool hung = halhost_close(&diag) != 0;
    (void)fflush(stdout);
    fputs(diag.text, stderr);
    hal_session_free(session);
    if (hung) {
        fputs("hm2host: a component hangs; ending without unloading\n", stderr);
        _exit(EXIT_HUNG); /* its thread must not run while libraries take themselves down */
    }
    return status && taken_signal ? 128 + taken_signal : status;
}

int main(const int argc, char *const argv[])
{
    static struct arguments arguments = {.cpu = HALHOST_CPU_DEFAULT};
    static char own[PATH_MAX + 16];
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    const int status = parse(&arguments, argc, argv);
    if (status)
        return status < 0 ? 0 : status;
    add_default_folders(&arguments, own);
    catch_signals();
    return run_host(&arguments);
}
