/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "folder.h"

#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "process.h"

#define LIMIT_MS 60000

void folder_make(char path[const FOLDER_PATH], const char *const name)
{
    snprintf(path, FOLDER_PATH, "/tmp/check-%s-XXXXXX", name);
    ck_assert_ptr_nonnull(mkdtemp(path));
    ck_assert_int_eq(chmod(path, 0755), 0);
}

void folder_remove(const char *const path)
{
    static struct process rm;
    const char *const argv[] = {"rm", "-rf", path, NULL};
    ck_assert_int_eq(process_run(&rm, argv, LIMIT_MS), 0);
}
