/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Strings for HAL components. */
#ifndef RTAPI_STRING_H
#define RTAPI_STRING_H

#include <string.h>

#include <rtapi.h>
#include <rtapi_gfp.h>

RTAPI_BEGIN_DECLS

/* Cut a text at white space into a NULL-terminated array, to be given back with rtapi_argv_free(). NULL = no memory.
 * *argc (may be NULL) receives the number of words. */
char **rtapi_argv_split(rtapi_gfp_t flags, const char *text, int *argc);
void rtapi_argv_free(char **argv);

#define rtapi_kstrdup(text, flags) strdup(text)

/* Copy or append within size bytes, always terminated. They return the length that the result wanted to have. */
static inline size_t rtapi_strlcpy(char *to, const char *from, size_t size)
{
    const size_t length = strlen(from);
    if (size > 0) {
        const size_t kept = length < size ? length : size - 1;
        memcpy(to, from, kept);
        to[kept] = '\0';
    }
    return length;
}

static inline size_t rtapi_strlcat(char *to, const char *from, size_t size)
{
    const size_t used = strnlen(to, size);
    return used + rtapi_strlcpy(to + used, from, size - used);
}

/* The same for a destination that is an array (not a pointer): its size is taken from its type. */
#define rtapi_strxcpy(to, from) rtapi_strlcpy((to), (from), sizeof(to))
#define rtapi_strxcat(to, from) rtapi_strlcat((to), (from), sizeof(to))

RTAPI_END_DECLS

#endif
