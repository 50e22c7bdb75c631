/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "flash_images.h"

#include <stdio.h>
#include <string.h>

#define HEADER_END 256u

struct writer {
    uint8_t *to;
    size_t used;
};

static void put(struct writer *const w, const void *const bytes, const size_t len)
{
    memcpy(w->to + w->used, bytes, len);
    w->used += len;
}

static void put_be16(struct writer *const w, const unsigned value)
{
    put(w, (const uint8_t[]){(uint8_t)(value >> 8), (uint8_t)value}, 2);
}

static void put_noise(struct writer *const w, const size_t end, uint64_t seed)
{
    while (w->used < end) {
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        w->to[w->used++] = (uint8_t)(seed >> 56);
    }
}

/* ---- Xilinx -------------------------------------------------------------------------------------------------------
 */

static void put_text(struct writer *const w, const char key, const char *const text)
{
    put(w, &key, 1);
    put_be16(w, (unsigned)strlen(text) + 1);
    put(w, text, strlen(text) + 1);
}

static void put_register(struct writer *const w, const unsigned header, const unsigned value)
{
    put_be16(w, header);
    put_be16(w, value);
}

static void put_packets(struct writer *const w, const struct xilinx_file *const file)
{
    const uint32_t idcode = file->idcode ? file->idcode : 0x04001093u;
    for (unsigned i = 0; i < 16; i++)
        put(w, "\xFF", 1);
    put(w, "\xAA\x99\x55\x66", 4);
    put_register(w, 0x30A1, 0x0007); /* CMD: reset CRC */
    put_be16(w, 0x31C2);
    put_be16(w, idcode >> 16);
    put_be16(w, idcode & 0xFFFFu);
    put_register(w, 0x3141, file->cor1 ? file->cor1 : 0x3D00);
    if (!file->no_cor2)
        put_register(w, 0x3161, file->cor2 ? file->cor2 : 0x8DEC);
    if (file->multiboot) {
        put_register(w, 0x3261, 0);
        put_register(w, 0x3301, 0x0100);
    } else {
        for (unsigned i = 0; i < 4; i++)
            put_be16(w, 0x2000);
    }
    put_be16(w, 0x5060); /* frame data */
}

size_t make_xilinx(const struct xilinx_file *const file, uint8_t *const to)
{
    struct writer w = {to, 0};
    const size_t payload = file->payload ? file->payload : 340604;
    put(&w, "\x00\x09\x0F\xF0\x0F\xF0\x0F\xF0\x0F\xF0\x00\x00\x01", 13);
    put_text(&w, 'a', file->design ? file->design : "TopEthernetHostMot2.ncd;UserID=0xFFFFFFFF");
    put_text(&w, 'b', file->part ? file->part : "6slx9tqg144");
    put_text(&w, 'c', "2016/06/01");
    put_text(&w, 'd', "17:37:31");
    put(&w, "e", 1);
    put_be16(&w, (unsigned)(payload >> 16));
    put_be16(&w, (unsigned)(payload & 0xFFFFu));
    const size_t start = w.used;
    put_packets(&w, file);
    put_noise(&w, start + payload, file->seed);
    return start + payload;
}

/* ---- Efinix -------------------------------------------------------------------------------------------------------
 */

size_t make_efinix(const struct efinix_file *const file, uint8_t *const to)
{
    static const uint8_t pointers[8] = {0x0D, 0x30, 0x00, 0x0D, 0x30, 0x00, 0x08, 0x00};
    struct writer w = {to, 0};
    char text[HEADER_END + 1];
    const int len = snprintf(text, sizeof text,
                             "Version: 2021.2.323.4.6\nGenerated: Mon Jun  5 12:41:51 2023\n\nProject: %s\n"
                             "Family: %s\nDevice: %s\nWidth: 1\nMode: %s\nPADDED_BITS: 0\n",
                             file->project ? file->project : "/home/mesa/efinity/2021.2/project/hostmot2/7i96s",
                             file->family ? file->family : "Trion", file->part ? file->part : "T20F256",
                             file->mode ? file->mode : "active");
    put(&w, text, (size_t)len);
    while (w.used < HEADER_END)
        put(&w, "\n", 1);
    put(&w, "\x16\x8A\x22\x36\xFF\xF2", 6);
    put_noise(&w, HEADER_END + 0x48, file->seed);
    if (file->fallback)
        put(&w, pointers, sizeof pointers);
    else
        put(&w, (const uint8_t[8]){0}, 8);
    const size_t end = file->bytes ? file->bytes : file->fallback ? 680000 : 678650;
    put_noise(&w, file->fallback && end > 678650 ? 678650 : end, file->seed + 1);
    while (w.used < end)
        put(&w, "\xFF", 1);
    return w.used;
}
