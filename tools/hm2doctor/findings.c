/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <stdarg.h>

#include "doctor.h"

struct finding *find(struct findings *const findings, const char *const check, const enum grade grade,
                     const char *const format, ...)
{
    if (findings->count >= MAX_FINDINGS)
        return NULL;
    struct finding *const finding = &findings->list[findings->count++];
    va_list values;
    va_start(values, format);
    vsnprintf(finding->what, sizeof finding->what, format, values);
    va_end(values);
    finding->check = check;
    finding->grade = grade;
    return finding;
}

void remedy(struct finding *const finding, const bool at_once, const char *const format, ...)
{
    if (!finding)
        return;
    va_list values;
    va_start(values, format);
    vsnprintf(finding->remedy, sizeof finding->remedy, format, values);
    va_end(values);
    finding->at_once = at_once;
}
