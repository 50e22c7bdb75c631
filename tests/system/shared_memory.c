/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "shared_memory.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>

void *shared_memory(const size_t size)
{
    void *const memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory != MAP_FAILED)
        return memory;
    perror("shared memory");
    exit(EXIT_FAILURE);
}
