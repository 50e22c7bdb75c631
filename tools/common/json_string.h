/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef TOOLS_JSON_STRING_H
#define TOOLS_JSON_STRING_H

#include <stdio.h>

/* Print a text as a JSON string, quotes included. What is UTF-8 stays as it is; any other byte above ASCII becomes the
 * character of that number, which is right for the Windows alphabet of DBC files and harmless for what is broken. */
void json_string(FILE *out, const char *text);

#endif
