/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "report_draw.h"

#include <string.h>

#define DB25_IO      17u
#define DB25_PINS    25u
#define HEADER_IO    24u
#define HEADER_PINS  50u
#define MOST_PINS    50u
#define PITCH        34u
#define RADIUS       13u
#define TERMINALS_IN 18u /* in a row */
#define FITTING      8u  /* characters under one */

void html_text(FILE *const out, const char *const text)
{
    for (const char *c = text; *c; c++) {
        switch (*c) {
        case '<':
            fputs("&lt;", out);
            break;
        case '>':
            fputs("&gt;", out);
            break;
        case '&':
            fputs("&amp;", out);
            break;
        case '"':
            fputs("&quot;", out);
            break;
        default:
            fputc((unsigned char)*c < ' ' ? ' ' : *c, out);
        }
    }
}

static unsigned io_of(const struct connector *const c, const unsigned pin)
{
    return c->port * c->rom->port_width + pin;
}

static unsigned pin_count(const struct connector *const c)
{
    const unsigned first = io_of(c, 0), left = c->rom->pin_count > first ? c->rom->pin_count - first : 0;
    return left < c->rom->port_width ? left : c->rom->port_width;
}

static const char *kind_of(const struct hm2_pd *const pd)
{
    if (pd->secondary_tag == HM2_GTAG_NONE)
        return "gpio";
    return pd->secondary_pin & HM2_PIN_OUTPUT ? "out" : "in";
}

/* "StepGen 0 Step/Table1", or nothing */
static void function_of(const struct hm2_pd *const pd, char *const text, const size_t size)
{
    char tag[48], function[48];
    text[0] = '\0';
    if (pd->secondary_tag != HM2_GTAG_NONE)
        snprintf(text, size, "%s %u %s", tag_text(pd->secondary_tag, false, tag, sizeof tag),
                 pd->secondary_unit & 0x7Fu, pin_text(pd, false, function, sizeof function));
}

static const char *terminal_of(const struct connector *const c, const unsigned pin)
{
    return c->terminals && pin < c->terminals->count ? c->terminals->terminals[pin] : "";
}

/* ---- drawing ----------------------------------------------------------------------------------------------------- */

static void draw_pin(FILE *const out, const struct connector *const c, const int pin, const unsigned x,
                     const unsigned y, const unsigned number)
{
    char function[128] = "";
    const struct hm2_pd *const pd = pin < 0 ? NULL : &c->rom->pins[io_of(c, (unsigned)pin)];
    if (pd)
        function_of(pd, function, sizeof function);
    fprintf(out, "<g><title>%u", number);
    if (pd)
        fprintf(out, ": I/O %u ", io_of(c, (unsigned)pin));
    html_text(out, function);
    fprintf(out, "</title><circle class=\"%s\" cx=\"%u\" cy=\"%u\" r=\"%u\"/><text x=\"%u\" y=\"%u\">%u</text></g>\n",
            pd ? kind_of(pd) : "gnd", x, y, RADIUS, x, y + 4, number);
}

/* Two rows: of a DB25 the second has one less and stands between; of a header odd over even. */
static void draw_two_rows(FILE *const out, const struct connector *const c, const unsigned pins)
{
    int carries[MOST_PINS + 1];
    const bool db25 = pins == DB25_PINS;
    const unsigned columns = (pins + 1) / 2, width = (columns + 1) * PITCH, height = 3 * PITCH;
    for (unsigned number = 0; number <= pins; number++)
        carries[number] = -1;
    for (unsigned pin = 0; pin < pin_count(c); pin++)
        carries[hm2_connector_pin(c->rom->port_width, pin) % (pins + 1)] = (int)pin;
    fprintf(out,
            "<svg class=\"pinout\" viewBox=\"0 0 %u %u\" width=\"%u\" height=\"%u\">"
            "<rect class=\"shell\" x=\"4\" y=\"4\" width=\"%u\" height=\"%u\" rx=\"%u\"/>\n",
            width, height, width, height, width - 8, height - 8, db25 ? 24u : 4u);
    for (unsigned number = 1; number <= pins; number++) {
        const unsigned column = db25 ? (number - 1) % columns : (number - 1) / 2;
        const unsigned second = db25 ? number > columns : number % 2 == 0;
        draw_pin(out, c, carries[number], PITCH + column * PITCH + (db25 && second ? PITCH / 2 : 0),
                 PITCH + second * PITCH, number);
    }
    fputs("</svg>\n", out);
}

/* Terminals in the order of the I/O pins. */
static void draw_strip(FILE *const out, const struct connector *const c)
{
    const unsigned count = pin_count(c), rows = (count + TERMINALS_IN - 1) / TERMINALS_IN;
    const unsigned cell = 56, width = (count < TERMINALS_IN ? count : TERMINALS_IN) * cell + 8;
    fprintf(out, "<svg class=\"pinout\" viewBox=\"0 0 %u %u\" width=\"%u\" height=\"%u\">\n", width, rows * 62 + 4,
            width, rows * 62 + 4);
    for (unsigned pin = 0; pin < count; pin++) {
        char function[128];
        const struct hm2_pd *const pd = &c->rom->pins[io_of(c, pin)];
        const unsigned x = 4 + pin % TERMINALS_IN * cell, y = 4 + pin / TERMINALS_IN * 62;
        function_of(pd, function, sizeof function);
        fprintf(out, "<g><title>");
        html_text(out, terminal_of(c, pin));
        fprintf(out, ": I/O %u ", io_of(c, pin));
        html_text(out, function);
        fprintf(out,
                "</title><rect class=\"pin %s\" x=\"%u\" y=\"%u\" width=\"%u\" height=\"36\"/><text x=\"%u\" "
                "y=\"%u\">%u</text><text x=\"%u\" y=\"%u\"",
                kind_of(pd), x, y, cell - 4, x + cell / 2 - 2, y + 22, io_of(c, pin), x + cell / 2 - 2, y + 50);
        if (strlen(terminal_of(c, pin)) > FITTING) /* squeezed */
            fprintf(out, " textLength=\"%u\" lengthAdjust=\"spacingAndGlyphs\"", cell - 6);
        fputc('>', out);
        html_text(out, terminal_of(c, pin));
        fputs("</text></g>\n", out);
    }
    fputs("</svg>\n", out);
}

/* ---- table ------------------------------------------------------------------------------------------------------- */

static void put_pins(FILE *const out, const struct connector *const c)
{
    fputs("<table class=\"pins\"><tr><th>Pin</th><th>I/O</th><th>Module</th><th>Instance</th><th>Function</th>"
          "<th>Direction</th></tr>\n",
          out);
    for (unsigned pin = 0; pin < pin_count(c); pin++) {
        const struct hm2_pd *const pd = &c->rom->pins[io_of(c, pin)];
        const bool module = pd->secondary_tag != HM2_GTAG_NONE;
        char text[48];
        fputs("<tr><td>", out);
        if (c->terminals)
            html_text(out, terminal_of(c, pin));
        else
            fprintf(out, "%u", hm2_connector_pin(c->rom->port_width, pin));
        fprintf(out, "</td><td class=\"n\">%u</td><td>", io_of(c, pin));
        html_text(out, module ? tag_text(pd->secondary_tag, false, text, sizeof text) : "");
        fputs("</td><td class=\"n\">", out);
        if (module && pd->secondary_unit & 0x80u)
            fputs("all", out);
        else if (module)
            fprintf(out, "%u", pd->secondary_unit);
        fputs("</td><td>", out);
        html_text(out, module ? pin_text(pd, false, text, sizeof text) : "");
        fprintf(out, "</td><td>%s</td></tr>\n", !module ? "" : pd->secondary_pin & HM2_PIN_OUTPUT ? "out" : "in");
    }
    fputs("</table>\n", out);
}

void draw_connector(FILE *const out, const struct connector *const c)
{
    fputs("<h3>", out);
    html_text(out, c->name);
    if (c->daughter) {
        fputs(" &rarr; ", out);
        html_text(out, c->daughter);
    }
    fputs("</h3>\n", out);
    if (c->rom->port_width == DB25_IO && (!c->terminals || strstr(terminal_of(c, 0), "DB25")))
        draw_two_rows(out, c, DB25_PINS);
    else if (c->rom->port_width == HEADER_IO)
        draw_two_rows(out, c, HEADER_PINS);
    else
        draw_strip(out, c);
    put_pins(out, c);
}
