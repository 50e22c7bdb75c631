/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The one place where the library's points become HAL pins and parameters.
 *
 * It uses only the typed calls that LinuxCNC 2.9, LinuxCNC master and this project's host have in common, so one
 * source builds against the headers of each (hal-interface 5.7). All calls happen in rtapi_app_main().
 */
#ifndef HAL_BINDER_H
#define HAL_BINDER_H

#include <hm2/points.h>

struct hal_binder {
    struct hm2_binder binder; /* hand this to the library */
    int comp_id;
};

/* comp_id is what hal_init() returned; the objects belong to that component. HAL frees them in hal_exit(). */
void hal_binder_init(struct hal_binder *hal, int comp_id);

#endif
