/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Recorded traces of tests/data as part of a unit test. */
#ifndef TRACE_FOLDER_H
#define TRACE_FOLDER_H

#include "replay.h"

/* Replays tests/data/NAME and prints what differs. Fails the running test when the folder cannot be played. */
struct replay_totals replay_data(const char *name);

#endif
