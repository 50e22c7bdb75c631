/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A HAL host for unit tests: built-in components, collected messages, a session whose output is collected. */
#ifndef HAL_RIG_H
#define HAL_RIG_H

#define RTAPI 1
#include <hal.h>
#include <rtapi.h>

#include "halhost.h"
#include "session.h"

/* cmocka set-up and clean-up: open and close the host. The clean-up fails when something was left behind. */
int hal_rig_open(void **state);
int hal_rig_close(void **state);

/* Everything that was printed as a message since the rig was opened, also by realtime threads. */
const char *hal_rig_messages(void);

/* Execute commands; returns the error, "" when there was none. What they printed is in hal_rig_output(). */
const char *hal_rig_run(const char *commands);
const char *hal_rig_output(void);
struct hal_session *hal_rig_session(void);

/*
 * Component "probe": `sets` times the pins in, out (float), io (bit), count (s32), word (u32), the parameters gain
 * (float, RW), seen (s32, RO), and the function probe.N. The function adds 1 to count, copies in to out and stores
 * rtapi_task_self() in seen. Its parameters, for tests of the loader:
 */
struct probe_arguments {
    int sets;
    int fail;      /* negative errno: leave with it after everything was created, without cleaning up */
    int not_ready; /* do not call hal_ready */
    int numbers[3];
    long wide;
    char *text;
    char *texts[2];
};
extern struct probe_arguments probe_seen; /* as the last load saw them; texts are copied to probe_texts */
extern char probe_texts[3][64];
extern unsigned probe_mains, probe_exits;
extern char probe_order[16]; /* exits so far: 'p' of probe, 't' of the second component, "tail" */

struct probe {
    hal_float_t *in, *out;
    hal_bit_t *io;
    hal_s32_t *count;
    hal_u32_t *word;
    hal_float_t gain;
    hal_s32_t seen;
};
/* Of the last load. */
extern struct probe *probes;
/* Called by the function of set 0 in every cycle when not NULL. */
extern void (*probe_hook)(struct probe *probe, long period_ns);

#endif
