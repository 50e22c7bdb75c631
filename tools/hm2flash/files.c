/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Files and their SHA-256, by libmd. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <sha2.h>

#include "../common/whole_file.h"
#include "cli.h"

#define SIDE_MOST 65536u
#define LIST_MOST 1048576u

static void digest(const uint8_t *const bytes, const size_t len, uint8_t hash[const FLASH_SHA256_BYTES])
{
    SHA2_CTX context;
    SHA256Init(&context);
    SHA256Update(&context, bytes, len);
    SHA256Final(hash, &context);
}

static void hash_text(const uint8_t hash[const FLASH_SHA256_BYTES], char text[const SHA256_TEXT])
{
    for (unsigned i = 0; i < FLASH_SHA256_BYTES; i++)
        snprintf(text + (size_t)2 * i, 3, "%02x", hash[i]);
}

void sha256_text(const uint8_t *const bytes, const size_t len, char text[const SHA256_TEXT])
{
    uint8_t hash[FLASH_SHA256_BYTES];
    digest(bytes, len, hash);
    hash_text(hash, text);
}

int check_side_file(struct cli *const cli, const char *const path, const uint8_t *const bytes, const size_t len,
                    const bool required, const char *const what)
{
    char side[4096], text[SHA256_TEXT];
    uint8_t expected[FLASH_SHA256_BYTES], found[FLASH_SHA256_BYTES];
    size_t side_len;
    snprintf(side, sizeof side, "%s.sha256", path);
    uint8_t *const content = whole_file(side, SIDE_MOST, &side_len);
    if (!content && errno == ENOENT && !required)
        return DONE;
    if (!content)
        return complain(cli, REFUSED, "Can't open checksum file '%s': %s. Make it with: sha256sum '%s' > '%s'", side,
                        strerror(errno), path, side);
    const int err = flash_side_file_parse((const char *)content, side_len, expected, &cli->diag);
    free(content);
    if (err < 0)
        return report(cli, err);
    digest(bytes, len, found);
    if (memcmp(found, expected, sizeof found) == 0) {
        say(cli, "%s integrity verification passed\n", what);
        return DONE;
    }
    say(cli, "%s integrity verification not passed\n", what);
    hash_text(found, text);
    return complain(cli, REFUSED, "%s has the SHA-256 %s, and not the one in %s: load it again", path, text, side);
}

int look_up_image(struct cli *const cli, const uint8_t *const bytes, const size_t len,
                  char card[const FLASH_TEXT_BYTES])
{
    uint8_t hash[FLASH_SHA256_BYTES];
    size_t list_len;
    card[0] = '\0';
    if (!cli->known)
        return DONE;
    uint8_t *const list = whole_file(cli->known, LIST_MOST, &list_len);
    if (!list)
        return complain(cli, REFUSED, "Can't open the list of known images '%s': %s", cli->known, strerror(errno));
    digest(bytes, len, hash);
    const int found = flash_known_image((const char *)list, list_len, hash, card, &cli->diag);
    free(list);
    return found < 0 ? report(cli, found) : DONE;
}

static int write_text(const struct cli *const cli, const char *const path, const char *const text)
{
    FILE *const file = fopen(path, "wx");
    const bool written = file && fputs(text, file) >= 0;
    const int error = errno;
    if (file && fclose(file) == 0 && written)
        return DONE;
    return complain(cli, FAILED, "Can't create file '%s': %s", path, strerror(error));
}

/* The hash as mesaflash and sha256sum read it, and where the dump is from, for people and for --restore-flash. */
int write_side_files(struct cli *const cli, const char *const path, const uint8_t *const bytes, const size_t len)
{
    const struct flash_card_info *const info = cli->info;
    const char *const slash = strrchr(path, '/');
    char side[4096], hash[SHA256_TEXT], text[1024];
    sha256_text(bytes, len, hash);
    snprintf(side, sizeof side, "%s.sha256", path);
    snprintf(text, sizeof text, "%s *./%s\n", hash, slash ? slash + 1 : path);
    int status = write_text(cli, side, text);
    if (status != DONE)
        return status;
    say(cli, "Checksum file '%s' created successfully,\nsha256: '%s'\n", side, hash);
    snprintf(side, sizeof side, "%s.card", path);
    snprintf(text, sizeof text, "card: %s\nmac: %02X:%02X:%02X:%02X:%02X:%02X\nfirmware: %u\nflash-id: 0x%02X\n",
             card_name(cli), info->mac[0], info->mac[1], info->mac[2], info->mac[3], info->mac[4], info->mac[5],
             info->firmware, (unsigned)info->flash_id & 0xFFu);
    status = write_text(cli, side, text);
    return status;
}
