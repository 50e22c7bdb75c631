/* SPDX-License-Identifier: GPL-2.0-or-later */
component frames_test "frames through a packet UART whose wires are joined, by LinuxCNC's own declarations";
pin out u32 sent "frames given to the card";
pin out u32 received "frames that came back as they were sent";
pin out u32 wrong "frames that did not";
pin out u32 skipped "frames that did not come back, though later ones did";
pin out u32 lost "calls of read that told of a loss";
option singleton yes;
option extra_setup yes;
function update nofp;
license "GPL";
include "hostmot2-serial.h";
;;
#define FRAMES 4
#define LONGEST 300

static char *port = "hm2_7i80.0.pktuart.0";
RTAPI_MP_STRING(port, "the packet UART");

/* The number of a frame, and what follows from it. */
static unsigned fill(unsigned char *data, unsigned number)
{
    unsigned len = 2 + number * 7 % (LONGEST - 2), i;
    data[0] = number & 0xFF;
    data[1] = number >> 8 & 0xFF;
    for (i = 2; i < len; i++)
        data[i] = number + i;
    return len;
}

static int is_right(const unsigned char *data, unsigned len, unsigned next)
{
    unsigned char expected[LONGEST];
    unsigned number = data[0] | data[1] << 8, i;
    if (len < 2 || number < next || fill(expected, number) != len)
        return 0;
    for (i = 0; i < len; i++)
        if (data[i] != expected[i])
            return 0;
    return 1;
}

FUNCTION(update)
{
    static unsigned next;
    unsigned char data[FRAMES * LONGEST];
    rtapi_u16 sizes[FRAMES], longest = LONGEST;
    rtapi_u8 frames = FRAMES;
    unsigned i, at = 0;
    int got = hm2_pktuart_read(port, data, &frames, &longest, sizes);
    lost += got < 0;
    for (i = 0; i < frames; at += sizes[i++]) {
        unsigned number = data[at] | data[at + 1] << 8;
        if (!is_right(data + at, sizes[i], next)) {
            wrong++;
            continue;
        }
        received++;
        skipped += number - next;
        next = number + 1;
    }
    if (got > 0 && at != (unsigned)got)
        wrong++;
    /* More than the line carries: most of the time there is no room. */
    frames = 1;
    sizes[0] = fill(data, sent);
    sent += sent < 65000 && hm2_pktuart_send(port, data, &frames, sizes) == sizes[0];
}

EXTRA_SETUP()
{
    (void)prefix;
    (void)extra_arg;
    /* 40 bits between frames, drive on; a frame ends after 20 bits, receiver on. */
    return hm2_pktuart_setup(port, 1000000, 40 << 8 | 1 << 6, 20 << 8 | 1 << 3, 1, 1);
}
