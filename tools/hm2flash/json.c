/* SPDX-License-Identifier: GPL-2.0-or-later */
/* One JSON object on a line of stdout. */
#include <stdio.h>
#include <string.h>

#include "../common/json_string.h"
#include "cli.h"

#define MAX_DEPTH 8u

static bool started[MAX_DEPTH];
static unsigned depth;
static bool printed;        /* an object */
static char problems[4096]; /* what was said on stderr, for the object of a command that fails */

static void comma(void)
{
    if (started[depth])
        fputs(", ", stdout);
    started[depth] = true;
}

static void put_key(const char *const key)
{
    comma();
    json_string(stdout, key);
    fputs(": ", stdout);
}

static void open_bracket(const char bracket)
{
    putchar(bracket);
    if (depth + 1 < MAX_DEPTH)
        depth++;
    started[depth] = false;
}

void json_begin(const struct cli *const cli)
{
    if (!cli->json)
        return;
    depth = 0;
    open_bracket('{');
    json_text(cli, "address", cli->address ? cli->address : "");
    if (cli->info)
        json_text(cli, "device", card_name(cli));
}

void json_text(const struct cli *const cli, const char *const key, const char *const value)
{
    if (!cli->json)
        return;
    put_key(key);
    json_string(stdout, value);
}

void json_number(const struct cli *const cli, const char *const key, const double value)
{
    if (!cli->json)
        return;
    put_key(key);
    printf("%.12g", value);
}

void json_bool(const struct cli *const cli, const char *const key, const bool value)
{
    if (!cli->json)
        return;
    put_key(key);
    fputs(value ? "true" : "false", stdout);
}

void json_array(const struct cli *const cli, const char *const key)
{
    if (!cli->json)
        return;
    put_key(key);
    open_bracket('[');
}

void json_object(const struct cli *const cli)
{
    if (!cli->json)
        return;
    comma();
    open_bracket('{');
}

void json_close(const struct cli *const cli, const char bracket)
{
    if (!cli->json)
        return;
    putchar(bracket);
    if (depth > 0)
        depth--;
}

void json_end(const struct cli *const cli)
{
    json_close(cli, '}');
    if (!cli->json)
        return;
    putchar('\n');
    printed = true;
}

void json_problem(const char *const text)
{
    const size_t len = strlen(problems), more = strlen(text);
    const int whole = (int)(more > 0 && text[more - 1] == '\n' ? more - 1 : more);
    snprintf(problems + len, sizeof problems - len, "%s%.*s", len > 0 ? "\n" : "", whole, text);
}

void json_failure(const struct cli *const cli, const int status)
{
    if (!cli->json || printed)
        return;
    json_begin(cli);
    json_bool(cli, "done", false);
    json_number(cli, "status", status);
    json_text(cli, "error", problems);
    json_end(cli);
}

void json_result(const struct cli *const cli, const char *const action)
{
    json_begin(cli);
    json_text(cli, "action", action);
    json_bool(cli, "done", true);
    json_end(cli);
}
