/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "checks.h"

#include <string.h>
#include <strings.h>

/* Size of the payload of real images (flash tool reference 2.2), and how far one may be from it (3.10). The packets of
 * Xilinx images tell where they end. Nothing in an Efinix image does that is known, but all have the same length from
 * the sync word on, to which fallback images add padding (3.11): what is shorter is cut off. */
static const struct {
    const char *part;
    size_t bytes, least_from_sync;
} image_sizes[] = {
    {"6slx9tqg144", 340884, 0}, {"6slx16ftg256", 464750, 0}, {"6slx25ftg256", 801602, 0}, {"T20F256", 679155, 678394}};
#define TOLERANCE 100u /* one part in so many */

static const struct {
    unsigned hazard;
    const char *what;
} hazards[] = {
    {FLASH_HAZARD_MULTIBOOT, "writes the registers that say where the FPGA boots from (built with multiboot features)"},
    {FLASH_HAZARD_NO_RESET, "does not start the fallback image after an error (built without reset_on_error)"},
    {FLASH_HAZARD_NO_CRC, "has its check sum switched off (built without CRC)"},
    {FLASH_HAZARD_NO_IDCODE, "does not say in its packets what FPGA it is for"},
};

bool flash_can_start(const enum flash_content content)
{
    return content == FLASH_XILINX_IMAGE || content == FLASH_EFINIX_IMAGE || content == FLASH_EFINIX_FALLBACK;
}

int flash_check_override(const struct flash_card *const card, const struct flash_options *const options,
                         struct hm2_diag *const diag)
{
    const char *const name = options->override;
    if (!name || strcasecmp(name, card->info.card_name) == 0 ||
        (card->info.board && strcasecmp(name, card->info.board->device) == 0))
        return 0;
    return hm2_diag_add(diag, HM2_ERR_MISMATCH, "the override names \"%s\", and this card is a \"%s\"", name,
                        card->info.card_name);
}

static bool overridden(const struct flash_options *const options)
{
    return options->override != NULL; /* that it names this card was checked before */
}

/* ---- the card --------------------------------------------------------------------------------------------------- */

int flash_check_card(const struct flash_card *const card, struct hm2_diag *const diag)
{
    enum { ROM_FPGA_SIZE = 5 };
    const struct flash_card_info *const info = &card->info;
    const uint32_t size = info->image.rom[ROM_FPGA_SIZE];
    int err = 0;
    if (!info->board)
        return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                            "the card calls itself \"%s\", which this program does not know: it can be read and not "
                            "written",
                            info->card_name);
    if (!info->chip)
        err = hm2_diag_add(diag, HM2_ERR_MISMATCH,
                           "the flash chip's ID is 0x%02X and the card gives its size as 2^%u bytes: no chip that is "
                           "known, so it can be read and not written",
                           (unsigned)info->flash_id & 0xFFu, info->space[LBP16_SPACE_FLASH].size_log2);
    const bool trion = info->board->family == FLASH_EFINIX;
    if (info->cookie == HM2_COOKIE && (trion ? size != info->board->fpga_size : size == 20))
        err = hm2_diag_add(diag, HM2_ERR_MISMATCH,
                           "the card calls itself \"%s\", whose FPGA is a %s, but its firmware says that it has %u "
                           "thousand gates: the two do not fit together",
                           info->card_name, info->board->part, (unsigned)size);
    return err;
}

/* ---- image and card --------------------------------------------------------------------------------------------- */

enum naming { NAMES_NONE, NAMES_THIS, NAMES_OTHER };

/* How much of the text is this board's name, with "_" for "-" and with or without the size behind it ("7i80hd"). */
static size_t match(const char *const text, const char *const device)
{
    const char *const dash = strchr(device, '-');
    const size_t stem = dash ? (size_t)(dash - device) : strlen(device);
    size_t len = 0;
    while (device[len] && strncasecmp(text[len] == '_' ? "-" : text + len, device + len, 1) == 0)
        len++;
    return device[len] == '\0' ? len : len >= stem ? stem : 0;
}

static enum naming naming_of(const struct flash_board *const board, const char *const text,
                             const struct flash_board **const other)
{
    const size_t own = match(text, board->device);
    const struct flash_board *row;
    size_t longest = own;
    *other = NULL;
    for (size_t i = 0; (row = flash_board_at(i)) != NULL; i++)
        if (match(text, row->device) > longest) {
            longest = match(text, row->device);
            *other = row;
        }
    return *other ? NAMES_OTHER : own > 0 ? NAMES_THIS : NAMES_NONE;
}

static const char *last_component(const char *const path)
{
    const char *const slash = strrchr(path, '/');
    const char *const backslash = strrchr(path, '\\');
    const char *const last = backslash > slash ? backslash : slash;
    return last ? last + 1 : path;
}

/* Same FPGA, other card: the image would start, without Ethernet, and nothing would start the fallback image (H3). */
static int check_name(const struct flash_board *const board, const struct flash_image *const image,
                      const struct flash_options *const options, struct hm2_diag *const diag)
{
    const char *const texts[] = {image->family == FLASH_EFINIX ? last_component(image->project) : "",
                                 options->file_name ? last_component(options->file_name) : "",
                                 options->known_card ? options->known_card : ""};
    static const char *const kinds[] = {"project", "file name", "entry in the list of known images,"};
    const struct flash_board *other;
    bool named = false;
    int err = 0;
    for (unsigned i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        const enum naming naming = naming_of(board, texts[i], &other);
        named = named || naming == NAMES_THIS;
        if (naming == NAMES_OTHER)
            err =
                hm2_diag_add(diag, HM2_ERR_MISMATCH,
                             "the image is for a %s, going by its %s \"%s\", and the card is a %s: it would start and "
                             "leave the card without Ethernet",
                             other->device, kinds[i], texts[i], board->device);
    }
    if (!named && err == 0)
        err = hm2_diag_add(diag, HM2_ERR_MISMATCH,
                           "neither the image nor its file name (\"%s\") says what card it is for; many cards have the "
                           "same FPGA. If you are sure that it is for the %s, say so: --override %s",
                           texts[1], board->device, board->device);
    return err;
}

/* UserID 7192 occurs in files for 7I92 and 7I93 only; FFFFFFFF says nothing (3.10). */
static int check_design(const struct flash_board *const board, const struct flash_image *const image,
                        struct hm2_diag *const diag)
{
    static const char top[] = "TopEthernetHostMot2", id_7192[] = "UserID=0x00007192";
    if (strncmp(image->design, top, sizeof top - 1) != 0)
        return hm2_diag_add(
            diag, HM2_ERR_MISMATCH,
            "the design is called \"%s\", those of Ethernet cards begin with \"%s\": the card could not "
            "be reached any more",
            image->design, top);
    if (strstr(image->design, id_7192) && strcmp(board->device, "7I92") != 0 && strcmp(board->device, "7I93") != 0)
        return hm2_diag_add(diag, HM2_ERR_MISMATCH, "the design \"%s\" is for a 7I92 or 7I93, and the card is a %s",
                            image->design, board->device);
    return 0;
}

/* A user image in the fallback area, or the reverse (H4). */
static int check_area(const struct flash_image *const image, const struct flash_options *const options,
                      struct hm2_diag *const diag)
{
    const bool fallback = options->area == FLASH_FALLBACK;
    if (image->family == FLASH_EFINIX)
        return image->pointers == fallback
                   ? 0
                   : hm2_diag_add(diag, HM2_ERR_MISMATCH, "this is a %s image and it shall be written to the %s area",
                                  image->pointers ? "fallback" : "user", fallback ? "fallback" : "user");
    if (overridden(options))
        return 0;
    const bool named = options->file_name && strstr(last_component(options->file_name), "fallback");
    return named == fallback
               ? 0
               : hm2_diag_add(diag, HM2_ERR_MISMATCH,
                              "the file name \"%s\" %s \"fallback\", and the image shall be written to the "
                              "%s area. If it is right, say so: --override CARD",
                              options->file_name ? options->file_name : "", named ? "says" : "does not say",
                              fallback ? "fallback" : "user");
}

static int check_size(const struct flash_image *const image, struct hm2_diag *const diag)
{
    for (size_t i = 0; i < sizeof image_sizes / sizeof image_sizes[0]; i++) {
        const size_t expected = image_sizes[i].bytes, margin = expected / TOLERANCE;
        if (strcmp(image->part, image_sizes[i].part) != 0)
            continue;
        if (image->payload_bytes + margin < expected || image->payload_bytes > expected + margin)
            return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                                "the image has %zu bytes, those for a %s have about %zu: it is cut off or something "
                                "else",
                                image->payload_bytes, image->part, expected);
        const size_t from_sync = image->payload_bytes - image->sync_at, least = image_sizes[i].least_from_sync;
        if (from_sync < least)
            return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                                "the image has %zu bytes from its sync word on, those for a %s have %zu: its end is "
                                "missing. Load the file again",
                                from_sync, image->part, least);
    }
    return 0;
}

int flash_check_fits(const struct flash_card *const card, const struct flash_image *const image,
                     const enum flash_area area, struct hm2_diag *const diag)
{
    const struct flash_range range = flash_area_range(card->info.board->family, card->info.chip, area);
    if (image->payload_bytes > 0 && image->payload_bytes <= range.bytes)
        return 0;
    return hm2_diag_add(diag, HM2_ERR_MISMATCH, "File Size too large to fit: %zu bytes into an area of %u",
                        image->payload_bytes, (unsigned)range.bytes);
}

static int check_fpga(const struct flash_board *const board, const struct flash_image *const image,
                      struct hm2_diag *const diag)
{
    int err = 0;
    if (image->family != board->family || strcmp(image->part, board->part) != 0)
        err = hm2_diag_add(diag, HM2_ERR_MISMATCH,
                           "Error: wrong bitfile destination device: %s, should be %s. Take the image for the %s",
                           image->part, board->part, board->device);
    if (image->idcode && board->idcode && image->idcode != board->idcode)
        err = hm2_diag_add(diag, HM2_ERR_MISMATCH, "the bitstream is for the FPGA with ID 0x%08X, the card has 0x%08X",
                           (unsigned)image->idcode, (unsigned)board->idcode);
    for (size_t i = 0; i < sizeof hazards / sizeof hazards[0]; i++)
        if (image->hazards & hazards[i].hazard)
            err = hm2_diag_add(diag, HM2_ERR_MISMATCH, "the image %s: a card could not be rescued from it",
                               hazards[i].what);
    return err;
}

/* The card would start its fallback image instead: a nuisance, and no danger (H18). */
static int check_damage(const struct flash_image *const image, struct hm2_diag *const diag)
{
    return image->hazards & FLASH_HAZARD_DAMAGED
               ? hm2_diag_add(diag, HM2_ERR_MISMATCH,
                              "the image is damaged: its contents do not fit the check sums in it, and no card would "
                              "start it. Load the file again")
               : 0;
}

int flash_check_image(const struct flash_card *const card, const struct flash_image *const image,
                      const struct flash_options *const options, struct hm2_diag *const diag)
{
    const struct flash_board *const board = card->info.board;
    const int results[] = {
        flash_check_override(card, options, diag),
        check_fpga(board, image, diag),
        board->family == image->family ? check_area(image, options, diag) : 0,
        flash_check_fits(card, image, options->area, diag),
        overridden(options) ? 0 : check_size(image, diag),
        overridden(options) ? 0 : check_damage(image, diag),
        overridden(options) ? 0 : check_name(board, image, options, diag),
        overridden(options) || image->family != FLASH_XILINX ? 0 : check_design(board, image, diag),
        options->area == FLASH_FALLBACK && !options->confirmed
            ? hm2_diag_add(diag, HM2_ERR_STATE,
                           "writing the fallback image, the one that rescues the card, needs a confirmation: --confirm "
                           "fallback")
            : 0,
    };
    int err = 0;
    for (size_t i = 0; i < sizeof results / sizeof results[0]; i++)
        err = results[i] < 0 ? results[i] : err;
    return err;
}

/* ---- dumps ------------------------------------------------------------------------------------------------------ */

static bool fits_family(const enum flash_family family, const enum flash_content content)
{
    if (content == FLASH_BLANK)
        return true;
    if (family == FLASH_XILINX)
        return content == FLASH_BOOT_BLOCK || content == FLASH_XILINX_IMAGE;
    return content == FLASH_EFINIX_IMAGE || content == FLASH_EFINIX_FALLBACK;
}

int flash_check_dump(const struct flash_card *const card, const uint8_t *const dump, const size_t len,
                     const struct flash_options *const options, struct hm2_diag *const diag)
{
    const struct flash_chip *const chip = card->info.chip;
    const enum flash_family family = card->info.board->family;
    if (len != chip->bytes)
        return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                            "Backup file size too %s for restore FLASH memory: %zu bytes, the chip has %u",
                            len > chip->bytes ? "large" : "small", len, (unsigned)chip->bytes);
    const enum flash_content first = flash_content_of(chip, dump);
    const enum flash_content fallback =
        flash_content_of(chip, dump + flash_area_range(family, chip, FLASH_FALLBACK).start);
    const enum flash_content user = flash_content_of(chip, dump + flash_area_range(family, chip, FLASH_USER).start);
    if (!fits_family(family, first) || !fits_family(family, fallback) || !fits_family(family, user))
        return hm2_diag_add(
            diag, HM2_ERR_MISMATCH,
            "the dump holds %s, %s and %s at its beginning, in the fallback and in the user area: it is "
            "not from a %s",
            flash_content_name(first), flash_content_name(fallback), flash_content_name(user),
            card->info.board->device);
    const int err = flash_check_override(card, options, diag);
    if (err < 0)
        return err;
    if (!flash_can_start(fallback) && !overridden(options))
        return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                            "the dump has no fallback image, so the card could not be rescued afterwards. If that is "
                            "right, say so: --override %s",
                            card->info.board->device);
    return 0;
}

/* ---- what is in the flash --------------------------------------------------------------------------------------- */

static int check_boot_block(const struct flash_survey *const survey, const struct flash_options *const options,
                            struct hm2_diag *const diag)
{
    switch (survey->sector0) {
    case FLASH_BOOT_BLOCK:
        return 0;
    case FLASH_BLANK:
    case FLASH_BOOT_OTHER_SIZE:
    case FLASH_BOOT_UNFINISHED:
        return options->fix_boot_block
                   ? 0
                   : hm2_diag_add(
                         diag, HM2_ERR_STATE,
                         "Error: BootSector is invalid: sector 0 holds %s, so the card would not find its user "
                         "image. Repair it with --fix-boot-block",
                         flash_content_name(survey->sector0));
    case FLASH_XILINX_IMAGE:
    case FLASH_UNKNOWN:
        return options->fix_boot_block && overridden(options)
                   ? 0
                   : hm2_diag_add(diag, HM2_ERR_STATE,
                                  "Error: BootSector is invalid: sector 0 holds %s, which is no damaged boot block. "
                                  "Keep it with --backup-flash; if it is of no use, --fix-boot-block --override CARD "
                                  "replaces it",
                                  flash_content_name(survey->sector0));
    case FLASH_EFINIX_IMAGE:
    case FLASH_EFINIX_FALLBACK:
    default:
        return 0; /* refused already: another family */
    }
}

int flash_check_content(const struct flash_card *const card, const struct flash_survey *const survey,
                        const struct flash_options *const options, struct hm2_diag *const diag)
{
    const bool trion = card->info.board->family == FLASH_EFINIX;
    const bool efinix = survey->sector0 == FLASH_EFINIX_IMAGE || survey->sector0 == FLASH_EFINIX_FALLBACK;
    const bool xilinx = survey->sector0 == FLASH_BOOT_BLOCK || survey->sector0 == FLASH_BOOT_OTHER_SIZE ||
                        survey->sector0 == FLASH_XILINX_IMAGE;
    int err = 0;
    if (trion ? xilinx : efinix)
        return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                            "the card calls itself \"%s\", which has an FPGA of %s, but sector 0 of its flash holds %s",
                            card->info.card_name, trion ? "Efinix" : "Xilinx", flash_content_name(survey->sector0));
    if (!trion)
        err = check_boot_block(survey, options, diag);
    const bool user = options->area == FLASH_USER;
    if (!overridden(options) && flash_can_start(user ? survey->user : survey->fallback) &&
        !flash_can_start(user ? survey->fallback : survey->user))
        err =
            hm2_diag_add(diag, HM2_ERR_STATE,
                         "the %s area holds the only image that the card could start (%s area: %s). Write the %s image "
                         "first; or, if the risk is known, --override %s",
                         user ? "user" : "fallback", user ? "fallback" : "user",
                         flash_content_name(user ? survey->fallback : survey->user), user ? "fallback" : "user",
                         card->info.board->device);
    return err;
}
