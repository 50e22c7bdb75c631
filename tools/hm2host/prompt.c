/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "prompt.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifdef HM2_HAVE_LIBEDIT
#include <histedit.h>
#endif

enum { NAME_BYTES = 128 };

struct prompt {
    struct hal_session *session;
    bool terminal;
    char *line; /* getline's, or a copy of the editor's */
    size_t capacity;
#ifdef HM2_HAVE_LIBEDIT
    EditLine *editor;
    History *history;
#endif
};

static size_t last_word_length(const char *const line)
{
    size_t length = strlen(line), word = 0;
    while (word < length && !isspace((unsigned char)line[length - word - 1]))
        word++;
    return word;
}

size_t prompt_complete(const struct hal_session *const session, const char *const line, char *const insert,
                       const size_t size)
{
    char name[NAME_BYTES], common[NAME_BYTES] = "";
    size_t state = 0, count = 0, shared = 0;
    while (hal_session_complete(session, line, &state, name, sizeof name)) {
        if (count++ == 0) {
            shared = strlen(name);
            memcpy(common, name, shared + 1);
        }
        size_t same = 0;
        while (same < shared && common[same] == name[same])
            same++;
        shared = same;
    }
    const size_t typed = last_word_length(line);
    const size_t more = shared > typed ? shared - typed : 0;
    (void)snprintf(insert, size, "%.*s%s", (int)more, common + typed, count == 1 ? " " : "");
    return count;
}

#ifdef HM2_HAVE_LIBEDIT

static const char *prompt_text(EditLine *const editor)
{
    (void)editor;
    return "hm2host: ";
}

static void list_names(const struct hal_session *const session, const char *const line)
{
    char name[NAME_BYTES];
    size_t state = 0;
    putchar('\n');
    while (hal_session_complete(session, line, &state, name, sizeof name))
        printf("%s  ", name);
    putchar('\n');
    (void)fflush(stdout);
}

static unsigned char on_tab(EditLine *const editor, const int key)
{
    (void)key;
    struct prompt *prompt = NULL;
    if (el_get(editor, EL_CLIENTDATA, &prompt) != 0 || !prompt)
        return CC_ERROR;
    const LineInfo *const info = el_line(editor);
    char line[1024], insert[NAME_BYTES + 2];
    (void)snprintf(line, sizeof line, "%.*s", (int)(info->cursor - info->buffer), info->buffer);
    const size_t count = prompt_complete(prompt->session, line, insert, sizeof insert);
    if (count == 0)
        return CC_ERROR;
    if (insert[0] && el_insertstr(editor, insert) == 0)
        return CC_REFRESH;
    list_names(prompt->session, line);
    return CC_REDISPLAY;
}

static void start_editor(struct prompt *const prompt)
{
    HistEvent event;
    prompt->history = history_init();
    prompt->editor = el_init("hm2host", stdin, stdout, stderr);
    if (!prompt->editor)
        return;
    if (prompt->history) {
        (void)history(prompt->history, &event, H_SETSIZE, 1000);
        (void)el_set(prompt->editor, EL_HIST, history, prompt->history);
    }
    (void)el_set(prompt->editor, EL_CLIENTDATA, prompt);
    (void)el_set(prompt->editor, EL_PROMPT, prompt_text);
    (void)el_set(prompt->editor, EL_EDITOR, "emacs");
    (void)el_set(prompt->editor, EL_SIGNAL, 1);
    (void)el_set(prompt->editor, EL_ADDFN, "hal-complete", "complete a HAL name", on_tab);
    (void)el_set(prompt->editor, EL_BIND, "^I", "hal-complete", NULL);
    (void)el_source(prompt->editor, NULL);
}

static const char *read_edited(struct prompt *const prompt)
{
    int length = 0;
    errno = 0;
    const char *const text = el_gets(prompt->editor, &length);
    if (!text || length <= 0)
        return errno == EINTR ? "" : NULL;
    free(prompt->line);
    prompt->line = strdup(text);
    if (!prompt->line)
        return NULL;
    prompt->line[strcspn(prompt->line, "\n")] = '\0';
    HistEvent event;
    if (prompt->history && prompt->line[0])
        (void)history(prompt->history, &event, H_ENTER, prompt->line);
    return prompt->line;
}

static void stop_editor(struct prompt *const prompt)
{
    if (prompt->editor)
        el_end(prompt->editor);
    if (prompt->history)
        history_end(prompt->history);
}

#endif

struct prompt *prompt_new(struct hal_session *const session)
{
    struct prompt *const prompt = calloc(1, sizeof *prompt);
    if (!prompt)
        return NULL;
    prompt->session = session;
    prompt->terminal = isatty(STDIN_FILENO) != 0;
#ifdef HM2_HAVE_LIBEDIT
    if (prompt->terminal)
        start_editor(prompt);
#endif
    return prompt;
}

void prompt_free(struct prompt *const prompt)
{
    if (!prompt)
        return;
#ifdef HM2_HAVE_LIBEDIT
    stop_editor(prompt);
#endif
    free(prompt->line);
    free(prompt);
}

const char *prompt_read(struct prompt *const prompt)
{
#ifdef HM2_HAVE_LIBEDIT
    if (prompt->editor)
        return read_edited(prompt);
#endif
    if (prompt->terminal) {
        printf("hm2host: ");
        (void)fflush(stdout);
    }
    errno = 0;
    const ssize_t length = getline(&prompt->line, &prompt->capacity, stdin);
    if (length < 0) {
        const bool interrupted = errno == EINTR;
        clearerr(stdin);
        return interrupted ? "" : NULL;
    }
    prompt->line[strcspn(prompt->line, "\n")] = '\0';
    return prompt->line;
}
