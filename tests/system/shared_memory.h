/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What processes of one program have together: Check runs each test in its own. */
#ifndef TEST_SHARED_MEMORY_H
#define TEST_SHARED_MEMORY_H

#include <stddef.h>

/* Memory that is 0, and one and the same in all children of this process. Ends the process when there is none; works
 * before the tests begin, too. */
void *shared_memory(size_t size);

#endif
