/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* INI files for substitution in HAL files: [SECTION] lines, NAME = value lines, comments after # or ; at line start. */
#ifndef HALHOST_INIFILE_H
#define HALHOST_INIFILE_H

#include <stddef.h>

#include <hm2/err.h>

struct inifile;

/* Parse a text (it is copied). NULL with the reason in diag. */
struct inifile *inifile_parse(const char *text, size_t length, const char *name, struct hm2_diag *diag);
/* First value of NAME in the section, without the blanks around it; NULL = there is none. */
const char *inifile_get(const struct inifile *ini, const char *section, const char *name);
void inifile_free(struct inifile *ini);

#endif
