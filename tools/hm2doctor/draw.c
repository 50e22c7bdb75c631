/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The histogram of the round trips as SVG: linear time, logarithmic numbers, so that the rare ones are seen. */
#include <math.h>

#include "doctor.h"

#define BARS   120u
#define WIDTH  960.0
#define HEIGHT 300.0
#define MARGIN 50.0
#define US     1e-3

void draw_rounds(FILE *const out, const struct rounds *const rounds, const long period_us)
{
    size_t counts[BARS] = {0}, most = 1;
    const int64_t longest = rounds->paced > 0 ? rounds->paced_ns[rounds->paced - 1] : 0;
    const int64_t span_ns = longest > period_us * 1000 ? longest : period_us * 1000;
    for (size_t i = 0; i < rounds->paced; i++) {
        const size_t bar = (size_t)(rounds->paced_ns[i] * (int64_t)(BARS - 1) / span_ns);
        counts[bar]++;
        most = counts[bar] > most ? counts[bar] : most;
    }
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" font-family=\"sans-serif\" "
            "font-size=\"12\">\n<title>Round trips</title>\n<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
            WIDTH + 2 * MARGIN, HEIGHT + 2 * MARGIN);
    for (unsigned i = 0; i < BARS; i++) {
        const double height = HEIGHT * log1p((double)counts[i]) / log1p((double)most);
        if (counts[i] > 0)
            fprintf(out, "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\" fill=\"#2f5d9b\"/>\n",
                    MARGIN + i * WIDTH / BARS, MARGIN + HEIGHT - height, WIDTH / BARS - 1, height);
    }
    const double period_x = MARGIN + (double)period_us * 1000 * (BARS - 1) / (double)span_ns * WIDTH / BARS;
    fprintf(out,
            "<line x1=\"%.2f\" y1=\"%.0f\" x2=\"%.2f\" y2=\"%.0f\" stroke=\"#d33\" stroke-dasharray=\"4 3\"/>\n"
            "<text x=\"%.0f\" y=\"20\">%zu replies, %zu lost; heights are logarithmic; red: the period, %ld us</text>\n"
            "<text x=\"%.0f\" y=\"%.0f\">0 us</text>\n"
            "<text x=\"%.0f\" y=\"%.0f\" text-anchor=\"end\">%.0f us</text>\n</svg>\n",
            period_x, MARGIN, period_x, MARGIN + HEIGHT, MARGIN, rounds->paced, rounds->lost, period_us, MARGIN,
            HEIGHT + MARGIN + 20, MARGIN + WIDTH, HEIGHT + MARGIN + 20, (double)span_ns * US);
}
