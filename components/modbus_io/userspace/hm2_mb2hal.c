/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * modbus_io as a program of LinuxCNC's HAL, in the place of mb2hal:
 *
 *     loadusr -W hm2_mb2hal config=spindle.ini
 *
 * There is no cycle to wait for it; it hands pins and words over by itself, every millisecond.
 */
#include <errno.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include <hal.h>
#include <rtapi.h>

#include "common/hal_binder.h"
#include "modbus_io/instance.h"

#define PERIOD_NS 1000000L

static const char usage[] =
    "Usage: hm2_mb2hal config=FILE\n"
    "Modbus devices as pins of LinuxCNC's HAL, from a file of mb2hal's or modbus_io's, until SIGTERM or SIGINT.\n"
    "The component is called as the file says, or, when it gives no name but mb2hal, as this program is.\n"
    "\n"
    "  --help     this text\n"
    "  --version  version\n"
    "\n"
    "Exit status: 0 ended by a signal, 1 the file or HAL would not have it, 2 wrong command line.\n";

static volatile sig_atomic_t ends;

static void on_signal(const int signal)
{
    (void)signal;
    ends = 1;
}

/* loadusr -W waits for a component with the name of the program. */
static const char *component_name(const struct instance *const instance, const char *const program)
{
    const char *const slash = strrchr(program, '/');
    if (strcmp(instance->map->component, "mb2hal") != 0)
        return instance->map->component;
    return slash ? slash + 1 : program;
}

static void run(const struct instance *const instance)
{
    const struct timespec period = {.tv_nsec = PERIOD_NS};
    struct timespec before, now;
    (void)clock_gettime(CLOCK_MONOTONIC, &before);
    while (!ends) {
        (void)nanosleep(&period, NULL);
        (void)clock_gettime(CLOCK_MONOTONIC, &now);
        pins_update(instance->pins, (now.tv_sec - before.tv_sec) * 1000000000L + now.tv_nsec - before.tv_nsec);
        before = now;
    }
}

/* 0 or a negative errno. */
static int serve(struct instance *const instance, const char *const path, const int component)
{
    struct hal_binder hal;
    hal_binder_init(&hal, component);
    int result = instance_make(instance, path, &hal.binder);
    if (!result)
        result = engine_start(instance->engine);
    if (!result)
        result = hal_ready(component);
    if (!result)
        run(instance);
    return result;
}

static int load(const char *const path, const char *const program)
{
    struct instance instance;
    int result = instance_read(&instance, path);
    if (!result) {
        const int component = hal_init(component_name(&instance, program));
        result = component < 0 ? component : serve(&instance, path, component);
        if (component >= 0)
            (void)hal_exit(component);
    }
    instance_free(&instance);
    return result;
}

int main(const int argc, char **const argv)
{
    static const char key[] = "config=";
    if (argc == 2 && strcmp(argv[1], "--help") == 0)
        return fputs(usage, stdout) < 0;
    if (argc == 2 && strcmp(argv[1], "--version") == 0)
        return puts("hm2_mb2hal " HM2_VERSION) < 0;
    if (argc != 2 || strncmp(argv[1], key, strlen(key)) != 0) {
        fprintf(stderr, "hm2_mb2hal: expected config=FILE and nothing else; see hm2_mb2hal --help\n");
        return 2;
    }
    (void)signal(SIGTERM, on_signal);
    (void)signal(SIGINT, on_signal);
    return load(argv[1] + strlen(key), argv[0]) ? 1 : 0;
}
