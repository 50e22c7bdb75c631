/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A folder for the files of a test. */
#ifndef TEST_FOLDER_H
#define TEST_FOLDER_H

#define FOLDER_PATH 32u

/* A new one, /tmp/check-NAME-XXXXXX, which everybody may read. Fails the test when there is none. */
void folder_make(char path[FOLDER_PATH], const char *name);
/* Away with it and all that is in it. */
void folder_remove(const char *path);

#endif
