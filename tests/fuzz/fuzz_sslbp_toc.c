/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Tables of contents and records of a smart-serial remote: the input is its memory, behind four bytes with the places
 * of PTOC and GTOC. Whatever it holds, discovery ends, nothing is read outside, and what it accepts can be packed.
 */
#include <stdlib.h>
#include <string.h>

#include <hm2/bytes.h>
#include <hm2/sslbp.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define USER_BITS 96u
#define MAX_READS 20000u /* two tables of 256 records of two texts each */

struct memory {
    const uint8_t *bytes;
    size_t size;
    unsigned reads;
};

static int read_memory(void *const access, const uint16_t address, const unsigned bytes, uint32_t *const value)
{
    struct memory *const memory = access;
    if ((bytes != 1 && bytes != 2 && bytes != 4) || ++memory->reads > MAX_READS)
        abort();
    *value = 0;
    for (unsigned i = 0; i < bytes; i++) {
        const size_t at = (uint16_t)(address + i);
        *value |= (at < memory->size ? (uint32_t)memory->bytes[at] : 0) << 8u * i;
    }
    return 0;
}

static void check_text(const char *const text)
{
    if (!memchr(text, 0, SSLBP_TEXT_SIZE))
        abort();
    for (const char *c = text; *c; c++)
        if (*c <= ' ' || *c > '~' || *c == '#' || (*c >= 'A' && *c <= 'Z'))
            abort();
}

static void check_field(const struct sslbp_field *const field)
{
    check_text(field->name);
    check_text(field->unit);
    if (field->min == field->max || field->min - field->min != 0 || field->max - field->max != 0)
        abort();
}

static void check_process(const struct sslbp_tables *const tables)
{
    uint32_t words[USER_BITS / 32u] = {0};
    unsigned in = 0, out = 0;
    for (unsigned i = 0; i < tables->process_count; i++) {
        const struct sslbp_field *const field = &tables->process[i];
        const unsigned bits = field->bits > 64 ? 64 : field->bits;
        check_field(field);
        if (field->direction != SSLBP_OUTPUT)
            (void)sslbp_get_bits(words, in, bits);
        if (field->direction != SSLBP_INPUT)
            sslbp_put_bits(words, out, bits, sslbp_to_unsigned(field->max, bits, field->min));
        in += field->direction == SSLBP_OUTPUT ? 0 : field->bits;
        out += field->direction == SSLBP_INPUT ? 0 : field->bits;
        if (in > USER_BITS || out > USER_BITS)
            abort();
    }
    if (in != tables->in_bits || out != tables->out_bits)
        abort();
}

static void check_printable(const char *text)
{
    if (!memchr(text, 0, SSLBP_TEXT_SIZE))
        abort();
    for (; *text; text++)
        if (*text < ' ' || *text > '~')
            abort();
}

static void check_list(const struct sslbp_memory *const access, const struct sslbp_identity *const identity)
{
    static struct sslbp_tables tables;
    struct hm2_diag diag = {0};
    if ((sslbp_read_list(access, identity, "remote", &tables, &diag) == 0) != (diag.problems == 0))
        abort();
    for (unsigned i = 0; i < tables.global_count; i++) {
        check_printable(tables.global[i].name);
        check_printable(tables.global[i].unit);
    }
    for (unsigned i = 0; i < tables.mode_count; i++)
        check_printable(tables.mode[i].name);
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    static struct sslbp_tables tables;
    struct hm2_diag diag = {0};
    if (size < 4)
        return 0;
    struct memory memory = {data + 4, size - 4, 0};
    const struct sslbp_memory access = {&memory, read_memory};
    const struct sslbp_identity identity = {.ptoc = hm2_get_le16(data), .gtoc = hm2_get_le16(data + 2)};
    check_list(&access, &identity);
    memory.reads = 0;
    const int err = sslbp_read_tables(&access, &identity, USER_BITS, "remote", &tables, &diag);
    if ((err == 0) != (diag.problems == 0))
        abort();
    if (err < 0)
        return 0;
    check_process(&tables);
    for (unsigned i = 0; i < tables.global_count; i++)
        check_field(&tables.global[i]);
    for (unsigned i = 0; i < tables.mode_count; i++)
        check_text(tables.mode[i].name);
    return 0;
}
