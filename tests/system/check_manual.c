/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Manual pages say what the programs do: options name for name in both directions, points and module parameters of
 * hm2_lbp16(9), words of its configuration string, and references among our own pages.
 */
#include <check.h>
#include <ctype.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <hm2/config.h>

#include "process.h"
#include "suite.h"

#define END_MS    20000
#define NAMES     512
#define NAME_SIZE 96

static struct process program;

/* ---- sets of names ---------------------------------------------------------------------------------------------- */

struct names {
    unsigned count;
    char text[NAMES][NAME_SIZE];
};

static bool has(const struct names *const names, const char *const text)
{
    for (unsigned i = 0; i < names->count; i++)
        if (strcmp(names->text[i], text) == 0)
            return true;
    return false;
}

static void add(struct names *const names, const char *const text)
{
    if (has(names, text))
        return;
    ck_assert_uint_lt(names->count, NAMES);
    snprintf(names->text[names->count++], NAME_SIZE, "%s", text);
}

static void expect_same(const struct names *const a, const char *const a_is, const struct names *const b,
                        const char *const b_is)
{
    for (unsigned i = 0; i < a->count; i++)
        ck_assert_msg(has(b, a->text[i]), "\"%s\" is in %s, but not in %s", a->text[i], a_is, b_is);
    for (unsigned i = 0; i < b->count; i++)
        ck_assert_msg(has(a, b->text[i]), "\"%s\" is in %s, but not in %s", b->text[i], b_is, a_is);
    ck_assert_uint_gt(a->count, 0);
}

/* ---- files ------------------------------------------------------------------------------------------------------ */

static FILE *open_page(const char *const name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/man/%s", TEST_SOURCE, name);
    FILE *file = fopen(path, "r");
    if (!file) {
        snprintf(path, sizeof path, "%s/man/%s", TEST_BUILD, name);
        file = fopen(path, "r");
    }
    ck_assert_msg(file != NULL, "there is no page %s", name);
    return file;
}

static bool page_exists(const char *const name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/man/%s", TEST_SOURCE, name);
    if (access(path, R_OK) == 0)
        return true;
    snprintf(path, sizeof path, "%s/man/%s", TEST_BUILD, name);
    return access(path, R_OK) == 0;
}

static void run(const char *const name, const char *const option)
{
    const char *const argv[] = {process_built(name), option, NULL};
    ck_assert_msg(process_run(&program, argv, END_MS) == 0, "%s %s: %s", name, option, program.text);
}

/* ---- options ---------------------------------------------------------------------------------------------------- */

static size_t word_len(const char *const text)
{
    size_t len = 0;
    while (isalnum((unsigned char)text[len]) || (text[len] == '-' && len > 0))
        len++;
    return len;
}

/* The options at the start of a help line: "  -e, --execute COMMAND   ..."; other lines have none. */
static void take_help_line(const char *at, struct names *const options)
{
    char name[NAME_SIZE];
    if (strncmp(at, "  ", 2) != 0)
        return;
    at += strspn(at, " ");
    while (*at == '-') {
        const size_t dashes = strspn(at, "-"), len = word_len(at + dashes);
        if (len == 0)
            return;
        snprintf(name, sizeof name, "%.*s", (int)(dashes + len), at);
        add(options, name);
        at += dashes + len;
        if (strncmp(at, ", ", 2) != 0)
            return;
        at += 2;
    }
}

static void take_help(const char *const tool, struct names *const options)
{
    options->count = 0;
    run(tool, "--help");
    for (const char *line = program.text; *line; line += strcspn(line, "\n"), line += *line == '\n')
        take_help_line(line, options);
}

/* The options of an ".It Fl" line: "Fl Fl name", "Fl -name" or "Fl x". */
static void take_item(const char *at, struct names *const options)
{
    char name[NAME_SIZE];
    for (at = strstr(at, "Fl "); at; at = strstr(at, "Fl ")) {
        const bool twice = strncmp(at, "Fl Fl ", 6) == 0;
        at += twice ? 6 : 3;
        const bool dash = *at == '-';
        at += dash;
        snprintf(name, sizeof name, "%s%.*s", twice || dash ? "--" : "-", (int)word_len(at), at);
        add(options, name);
    }
}

static void take_page_options(const char *const tool, struct names *const options)
{
    char page[300], line[1024];
    options->count = 0;
    snprintf(page, sizeof page, "%s.1", tool);
    FILE *const file = open_page(page);
    while (fgets(line, sizeof line, file))
        if (strncmp(line, ".It Fl ", 7) == 0)
            take_item(line, options);
    fclose(file);
}

START_TEST(every_option_is_in_the_help_and_in_the_page)
{
    static struct names help, page;
    unsigned tools = 0;
    DIR *const folder = opendir(TEST_SOURCE "/tools");
    ck_assert_ptr_nonnull(folder);
    for (const struct dirent *entry; (entry = readdir(folder));) {
        char help_is[300], page_is[300];
        if (entry->d_name[0] == '.' || strcmp(entry->d_name, "common") == 0)
            continue;
        tools++;
        snprintf(help_is, sizeof help_is, "%s --help", entry->d_name);
        snprintf(page_is, sizeof page_is, "%s(1)", entry->d_name);
        take_help(entry->d_name, &help);
        take_page_options(entry->d_name, &page);
        expect_same(&help, help_is, &page, page_is);
    }
    closedir(folder);
    ck_assert_uint_ge(tools, 4);
}
END_TEST

/* ---- hm2_lbp16(9) ----------------------------------------------------------------------------------------------- */

/* "stepgen.##.position-scale param float RW", from the tables. */
static void take_points(struct names *const points)
{
    char name[NAME_SIZE], kind[8], type[8], dir[8], text[NAME_SIZE + 32];
    points->count = 0;
    run("hm2points", "--text");
    const char *line = strchr(program.text, '\n'); /* after the heading */
    for (; line && line[1]; line = strchr(line + 1, '\n')) {
        ck_assert_int_eq(sscanf(line + 1, "%95s %7s %7s %7s", name, kind, type, dir), 4);
        snprintf(text, sizeof text, "%s %s %s %s", name, kind, type, dir);
        add(points, text);
    }
}

/* Without the backslashes that roff wants. */
static void unescape(char *const text)
{
    char *to = text;
    for (const char *from = text; *from; from++)
        if (*from == '\\')
            from += from[1] == '&';
        else
            *to++ = *from;
    *to = '\0';
}

static void take_page_points(struct names *const points)
{
    char line[1024], prefix[NAME_SIZE] = "", name[NAME_SIZE], kind[8], type[8], dir[8], text[2 * NAME_SIZE + 32];
    points->count = 0;
    FILE *const file = open_page("hm2_lbp16.9");
    while (fgets(line, sizeof line, file)) {
        unescape(line);
        if (sscanf(line, ".Ss %95s", prefix) == 1 && strcmp(prefix, "board") == 0)
            prefix[0] = '\0';
        if (sscanf(line, ".It Sy %95s Pq %7s %7s %7s", name, kind, type, dir) != 4)
            continue;
        snprintf(text, sizeof text, "%s%s%s %s %s %s", prefix, prefix[0] ? "." : "", name, kind, type, dir);
        add(points, text);
    }
    fclose(file);
}

START_TEST(every_point_is_in_the_page_of_the_component)
{
    static struct names tables, page;
    take_points(&tables);
    take_page_points(&page);
    expect_same(&tables, "hm2points", &page, "hm2_lbp16(9)");
    ck_assert_uint_gt(tables.count, 100);
}
END_TEST

/* What follows a macro such as "Cm " up to "=", for every occurrence in the .It lines of the page. */
static void take_page_keys(const char *const macro, struct names *const keys)
{
    char line[1024], name[NAME_SIZE];
    keys->count = 0;
    FILE *const file = open_page("hm2_lbp16.9");
    while (fgets(line, sizeof line, file)) {
        if (strncmp(line, ".It ", 4) != 0)
            continue;
        for (const char *at = line; (at = strstr(at, macro));) {
            at += strlen(macro);
            const size_t len = strcspn(at, "= \t\n");
            if (at[len] != '=')
                continue;
            snprintf(name, sizeof name, "%.*s", (int)len, at);
            add(keys, name);
        }
    }
    fclose(file);
}

START_TEST(every_module_parameter_is_in_the_page_of_the_component)
{
    static struct names there, page;
    const char *const argv[] = {process_built("hm2host"), "-e", "loadrt hm2_lbp16 ?=", NULL};
    ck_assert_int_eq(process_run(&program, argv, END_MS), 1);
    const char *at = strstr(program.text, "(it has ");
    ck_assert_msg(at != NULL, "%s", program.text);
    there.count = 0;
    for (at += strlen("(it has "); *at && *at != ')'; at += strspn(at, ", ")) {
        char name[NAME_SIZE];
        const size_t len = strcspn(at, ",)");
        snprintf(name, sizeof name, "%.*s", (int)len, at);
        add(&there, name);
        at += len;
        if (*at == ')')
            break;
    }
    take_page_keys("Cm ", &page);
    expect_same(&there, "the component", &page, "hm2_lbp16(9)");
}
END_TEST

START_TEST(every_word_of_the_configuration_in_the_page_is_accepted)
{
    static struct names page;
    static struct hm2_config config;
    take_page_keys("Li ", &page);
    ck_assert_uint_ge(page.count, 10);
    for (unsigned i = 0; i < page.count; i++) {
        struct hm2_diag diag = {.len = 0};
        char word[NAME_SIZE + 8];
        snprintf(word, sizeof word, "%s=1", page.text[i]);
        ck_assert_msg(hm2_config_parse(word, &config, &diag) == 0, "%s", diag.text);
    }
}
END_TEST

/* ---- other components ------------------------------------------------------------------------------------------- */

static const struct {
    const char *name, *load, *prefix;
} components[] = {
    {"scurve", "loadrt scurve", "scurve.0."},
    {"recorder", "loadrt recorder file=/dev/null", "recorder."},
    {"can_cia402", "loadrt can_cia402", "cia402.0."},
};
#define COMPONENTS ((int)(sizeof components / sizeof components[0]))

/* Rows of `show`: owner, type, direction, value, name. */
static void take_shown(const char *const prefix, struct names *const points)
{
    char type[8], dir[8], name[NAME_SIZE], text[NAME_SIZE + 32];
    points->count = 0;
    for (const char *line = program.text; *line; line += strcspn(line, "\n"), line += *line == '\n') {
        if (sscanf(line, "%*d %7s %7s %*s %95s", type, dir, name) != 3 || strncmp(name, prefix, strlen(prefix)) != 0 ||
            strstr(name, ".time") || strstr(name, ".tmax"))
            continue;
        char *const number = strstr(name, "-00");
        if (number)
            memcpy(number, "-##", 3);
        snprintf(text, sizeof text, "%s %s %s", name + strlen(prefix), type, dir);
        add(points, text);
    }
}

START_TEST(pages_of_other_components_list_their_points)
{
    static struct names shown, page;
    char file_name[64], line[1024], name[NAME_SIZE], type[8], dir[8], text[NAME_SIZE + 32];
    const char *const argv[] = {
        process_built("hm2host"), "-e", components[_i].load, "-e", "show pin", "-e", "show param", NULL};
    ck_assert_msg(process_run(&program, argv, END_MS) == 0, "%s", program.text);
    take_shown(components[_i].prefix, &shown);
    snprintf(file_name, sizeof file_name, "%s.9", components[_i].name);
    FILE *const file = open_page(file_name);
    page.count = 0;
    while (fgets(line, sizeof line, file)) {
        unescape(line);
        if (sscanf(line, ".It Sy %95s Pq %7s %7s", name, type, dir) != 3)
            continue;
        snprintf(text, sizeof text, "%s %s %s", name, type, dir);
        add(&page, text);
    }
    fclose(file);
    expect_same(&shown, "the component", &page, file_name);
}
END_TEST

START_TEST(every_component_has_a_page)
{
    unsigned found = 0;
    DIR *const folder = opendir(TEST_SOURCE "/components");
    ck_assert_ptr_nonnull(folder);
    for (const struct dirent *entry; (entry = readdir(folder));) {
        char page[300];
        if (entry->d_name[0] == '.' || strcmp(entry->d_name, "common") == 0)
            continue;
        snprintf(page, sizeof page, "%s.9", entry->d_name);
        ck_assert_msg(page_exists(page), "there is no page %s", page);
        found++;
    }
    closedir(folder);
    ck_assert_uint_ge(found, 3);
}
END_TEST

/* ---- references ------------------------------------------------------------------------------------------------- */

static void check_references(const char *const page)
{
    char line[1024], name[64], file_name[80];
    int section;
    FILE *const file = open_page(page);
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, ".Xr %63s %d", name, &section) != 2 ||
            (strncmp(name, "hm2", 3) != 0 && strcmp(name, "scurve") != 0 && strcmp(name, "recorder") != 0))
            continue;
        snprintf(file_name, sizeof file_name, "%s.%d", name, section);
        ck_assert_msg(page_exists(file_name), "%s refers to %s, which does not exist", page, file_name);
    }
    fclose(file);
}

START_TEST(references_among_our_pages_lead_somewhere)
{
    unsigned pages = 0;
    DIR *const folder = opendir(TEST_SOURCE "/man");
    ck_assert_ptr_nonnull(folder);
    for (const struct dirent *entry; (entry = readdir(folder));) {
        char page[300];
        snprintf(page, sizeof page, "%s", entry->d_name);
        const size_t len = strlen(page);
        if (page[0] == '.' || len < 3)
            continue;
        if (strcmp(page + len - 3, ".in") == 0)
            page[len - 3] = '\0';
        check_references(page);
        pages++;
    }
    closedir(folder);
    ck_assert_uint_ge(pages, 6);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("manual");
    TCase *const tests = tcase_create("pages");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, every_option_is_in_the_help_and_in_the_page);
    tcase_add_test(tests, every_point_is_in_the_page_of_the_component);
    tcase_add_test(tests, every_module_parameter_is_in_the_page_of_the_component);
    tcase_add_test(tests, every_word_of_the_configuration_in_the_page_is_accepted);
    tcase_add_loop_test(tests, pages_of_other_components_list_their_points, 0, COMPONENTS);
    tcase_add_test(tests, every_component_has_a_page);
    tcase_add_test(tests, references_among_our_pages_lead_somewhere);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
