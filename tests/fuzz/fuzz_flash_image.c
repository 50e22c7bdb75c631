/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Image files of both formats (first byte: 0 = Xilinx magic put in front, 1 = Efinix, else as they are): nothing is
 * read outside, and what is accepted holds together. */
#include <stdlib.h>
#include <string.h>

#include <hm2/flash.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(const bool condition)
{
    if (!condition)
        abort();
}

static void require_text(const char *text)
{
    require(memchr(text, '\0', FLASH_TEXT_BYTES) != NULL);
    for (; *text; text++)
        require(*text >= ' ' && *text <= '~');
}

static void use(const uint8_t *const file, const size_t len)
{
    struct flash_image image;
    struct hm2_diag diag = {0};
    const int err = flash_image_parse(file, len, &image, &diag);
    require((err == 0) == (diag.problems == 0));
    require_text(image.part);
    require_text(image.design);
    require_text(image.project);
    if (err != 0)
        return;
    require(image.payload >= file && image.payload_bytes <= len);
    require(image.payload + image.payload_bytes == file + len);
    require(image.sync_at + 4 <= image.payload_bytes);
    for (size_t i = 0; i < image.payload_bytes + FLASH_PAGE_BYTES; i++)
        (void)flash_image_byte(&image, i);
    if (image.payload_bytes >= (size_t)2 * FLASH_PAGE_BYTES)
        require(flash_content_name(flash_content_of(flash_chip_at(0), image.payload)) != NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    static const char xilinx[] = "\x00\x09\x0F\xF0\x0F\xF0\x0F\xF0\x0F\xF0\x00\x00\x01", efinix[] = "Version";
    const size_t lengths[] = {sizeof xilinx - 1, sizeof efinix - 1};
    const char *const fronts[] = {xilinx, efinix};
    if (size == 0)
        return 0;
    const size_t front = data[0] < 2 ? lengths[data[0]] : 0;
    uint8_t *const file = malloc(front + size); /* its own block: what is read behind it is seen */
    if (!file)
        return 0;
    if (front > 0)
        memcpy(file, fronts[data[0]], front);
    memcpy(file + front, data + 1, size - 1);
    use(file, front + size - 1);
    free(file);
    return 0;
}
