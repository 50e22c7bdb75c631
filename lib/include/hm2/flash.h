/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The configuration flash of an Ethernet card: image files, cards and chips, and the programmer.
 *
 * Registers: seed 000, "FLASH MEMORY REGISTERS" and "MEMORY SPACE 6 LAYOUT"; cards, areas, file formats and the hazards
 * H1 to H20 that the programmer guards against: flash tool reference, sections 2, 3 and 5.
 *
 * Everything runs on a struct link and in its clock, so that it works in virtual time as well. Parsers and tables are
 * pure. Functions that talk to a card return after at most a few bounded tries; none is for a realtime thread. Only
 * flash_card_new() and the functions that make jobs allocate. A card and its jobs are used by one thread at a time.
 *
 * Errors: HM2_ERR_MISMATCH and HM2_ERR_STATE = refused, nothing was changed; HM2_ERR_TIMEOUT = the card was lost;
 * HM2_ERR_IO = the flash does not hold what was written; HM2_ERR_MALFORMED = the file or an answer breaks its format.
 */
#ifndef HM2_FLASH_H
#define HM2_FLASH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/idrom.h>
#include <hm2/lbp16.h>
#include <hm2/link.h>
#include <hm2/sslbp.h>

#define FLASH_SECTOR_BYTES 65536u
#define FLASH_PAGE_BYTES   256u
#define FLASH_MAX_BYTES    4194304u /* largest chip of the table */
#define FLASH_MAX_SECTORS  (FLASH_MAX_BYTES / FLASH_SECTOR_BYTES)

enum flash_family { FLASH_XILINX, FLASH_EFINIX };
enum flash_area { FLASH_USER, FLASH_FALLBACK };

/* ---- cards and chips -------------------------------------------------------------------------------------------- */

struct flash_board {
    const char *device;    /* name on command lines: "7I76E" */
    const char *card_name; /* what the card calls itself in space 7, compared exactly: "7I76E-16" */
    const char *part;      /* FPGA as image files name it */
    enum flash_family family;
    uint32_t idcode;    /* of the FPGA (Xilinx); 0 = none */
    unsigned fpga_size; /* what the IDROM's field of that name must hold; 0 = not compared */
    unsigned io_ports, port_width;
    const char *connectors[4]; /* one a port */
    const char *terminals[4];  /* names of the built-in terminal tables, or NULL */
    unsigned leds;
    bool any_case;           /* the card's name is compared without regard to case */
    const char *second_chip; /* jumper that chooses one of two flash chips (2.3), only that one is seen; NULL = one */
};

/* Rows of the table (flash tool reference 2.1); NULL behind the last. */
HM2_API const struct flash_board *flash_board_at(size_t index);
/* By the name that the card gives, exactly; NULL = unknown card. */
HM2_API const struct flash_board *flash_board_of_card(const char *card_name);
/* The board with the longest device name that the text begins with, in any case; NULL when there is none. Command
 * lines, paths and file names are read so. */
HM2_API const struct flash_board *flash_board_named(const char *text);

struct flash_chip {
    uint8_t id;       /* electronic signature, low byte of FL_ID */
    const char *name; /* "16Mb" */
    uint32_t bytes, sector_bytes, page_bytes;
    unsigned program_typical_us, program_max_us; /* a page */
    unsigned erase_typical_ms, erase_max_ms;     /* a sector */
};

/* Rows of the table (2.2, 4.3), NULL behind the last; and by ID, NULL = unknown. */
HM2_API const struct flash_chip *flash_chip_at(size_t index);
HM2_API const struct flash_chip *flash_chip_of_id(uint8_t id);

struct flash_range {
    uint32_t start, bytes;
};

/* Where an area lies in a chip (2.2): the user area is the upper half; the fallback area is the lower one, on Xilinx
 * without its first sector, which holds the boot block. */
HM2_API struct flash_range flash_area_range(enum flash_family family, const struct flash_chip *chip,
                                            enum flash_area area);

/* ---- images ----------------------------------------------------------------------------------------------------- */

#define FLASH_TEXT_BYTES 160u

/* A file, taken apart. Texts are cut to their space, always terminated, and hold printable characters only. */
struct flash_image {
    enum flash_family family;
    char part[FLASH_TEXT_BYTES];                                  /* FPGA: "6slx9tqg144", "T20F256" */
    char design[FLASH_TEXT_BYTES];                                /* Xilinx: design name with its options */
    char date[FLASH_TEXT_BYTES], time[FLASH_TEXT_BYTES];          /* Xilinx */
    char compiler[FLASH_TEXT_BYTES], generated[FLASH_TEXT_BYTES]; /* Efinix, and below */
    char project[FLASH_TEXT_BYTES], series[FLASH_TEXT_BYTES];     /* project: its end when it is longer */
    char width[FLASH_TEXT_BYTES], mode[FLASH_TEXT_BYTES], padded_bits[FLASH_TEXT_BYTES];
    const uint8_t *payload; /* what goes into the flash, within the caller's data */
    size_t payload_bytes;
    size_t sync_at;   /* of the sync word in the payload */
    bool pointers;    /* Efinix: has next-image pointers, which only fallback images have */
    uint32_t idcode;  /* Xilinx: from the packets */
    unsigned hazards; /* enum flash_hazard: why this image would not be safe in any card */
};

/* Found in the packets of a Xilinx image (flash tool reference 3.10). */
enum flash_hazard {
    FLASH_HAZARD_MULTIBOOT = 1, /* writes the registers that say where to boot from */
    FLASH_HAZARD_NO_RESET = 2,  /* an error in it does not make the FPGA start the fallback image */
    FLASH_HAZARD_NO_CRC = 4,    /* its check sum is switched off */
    FLASH_HAZARD_NO_IDCODE = 8, /* names no FPGA in its packets */
    FLASH_HAZARD_DAMAGED = 16,  /* its contents do not fit its check sums, or their length the file (H18) */
};

/* Take a file apart. Every length is checked against the bytes left. HM2_ERR_MALFORMED, HM2_ERR_UNSUPPORTED (raw .bin,
 * .hex). The image points into data. */
HM2_API int HM2_MUST_CHECK flash_image_parse(const uint8_t *data, size_t len, struct flash_image *image,
                                             struct hm2_diag *diag);
/* The byte that stands at an offset of the image in the flash: payload, then the filler of its last page. The filler is
 * what mesaflash writes there, the byte 8192 before (3.7), so that each program verifies what the other wrote. */
HM2_API uint8_t flash_image_byte(const struct flash_image *image, size_t offset);

/* Side file FILE.sha256: the first 64 characters are the hash, any case, then white space or the end. */
#define FLASH_SHA256_BYTES 32u
HM2_API int HM2_MUST_CHECK flash_side_file_parse(const char *text, size_t len, uint8_t hash[FLASH_SHA256_BYTES],
                                                 struct hm2_diag *diag);

/* Look an image up in a list of known ones: each line has the SHA-256 of a file as side files have it, blanks, and the
 * name of the card that the file is for; "#" begins a line of comment. 1: *card is its name; 0: not in the list;
 * HM2_ERR_MALFORMED with the line's number. */
HM2_API int HM2_MUST_CHECK flash_known_image(const char *text, size_t len, const uint8_t hash[FLASH_SHA256_BYTES],
                                             char card[FLASH_TEXT_BYTES], struct hm2_diag *diag);

/* What stands at the beginning of an area. */
enum flash_content {
    FLASH_BLANK,
    FLASH_BOOT_BLOCK,      /* Xilinx, exactly what belongs there */
    FLASH_BOOT_OTHER_SIZE, /* a boot block for a chip of another size */
    FLASH_BOOT_UNFINISHED, /* a boot block whose erase or write was cut off: only some zeros are missing */
    FLASH_XILINX_IMAGE,
    FLASH_EFINIX_IMAGE,    /* without next-image pointers */
    FLASH_EFINIX_FALLBACK, /* with them */
    FLASH_UNKNOWN,
};

#define FLASH_BOOT_BLOCK_BYTES 64u
/* The boot block of a Xilinx card with this chip (3.8). */
HM2_API void flash_boot_block(const struct flash_chip *chip, uint8_t block[FLASH_BOOT_BLOCK_BYTES]);
/* Judge the first page of an area, or of the boot sector. */
HM2_API enum flash_content flash_content_of(const struct flash_chip *chip, const uint8_t page[2 * FLASH_PAGE_BYTES]);
HM2_API const char *flash_content_name(enum flash_content content);

/* ---- a card ----------------------------------------------------------------------------------------------------- */

struct flash_card;

struct flash_card_info {
    char card_name[17];              /* printable */
    const struct flash_board *board; /* NULL = not in the table: read only */
    uint16_t lbp_version, firmware, jumpers;
    uint32_t flash_id;             /* as read; the low byte counts */
    const struct flash_chip *chip; /* NULL = unknown ID, or its size contradicts the information area: read only */
    struct lbp16_info space[8];    /* information areas; cookie 0 = the card has none */
    uint16_t eeprom[LBP16_EEPROM_BYTES / 2]; /* words from 0 on */
    uint8_t mac[6], ip[4], netmask[4];       /* of the EEPROM */
    uint32_t cookie;
    struct hm2_image image;
    uint32_t local_pins[HM2_MAX_PINS]; /* descriptors behind those of the pins, tag 0x40 */
    unsigned local_pin_count;
};

/* Find out who is there: one exchange for the name, a few for the rest. The link stays the caller's. */
HM2_API int HM2_MUST_CHECK flash_card_new(struct flash_card **card, struct link *link, struct hm2_diag *diag);
HM2_API void flash_card_free(struct flash_card *card);
HM2_API const struct flash_card_info *flash_card_info(const struct flash_card *card);
HM2_API struct link *flash_card_link(const struct flash_card *card);

/* Is there a card at all? Send one small request; later take the answer, waiting until deadline_ns at most. For asking
 * many addresses at once. */
HM2_API int HM2_MUST_CHECK flash_probe(struct link *link);
HM2_API bool flash_probe_answered(struct link *link, int64_t deadline_ns);

/* Datagrams and what became of them. */
struct flash_counters {
    uint64_t sent, replies, resent, stale;
    uint64_t foreign;                         /* datagrams that the card got from others */
    uint64_t erases, pages, bytes_read;       /* done */
    unsigned pages_per_write, bytes_per_read; /* as large as they have grown */
    unsigned requests_ahead;                  /* to read, on their way at once; 1 after one was lost */
};
HM2_API struct flash_counters flash_card_counters(const struct flash_card *card);

/* First pages of sector 0 and of both areas. Reads the flash: ask flash_card_quiet() before. */
struct flash_survey {
    enum flash_content sector0, fallback, user;
};
HM2_API int HM2_MUST_CHECK flash_card_survey(struct flash_card *card, struct flash_survey *survey,
                                             struct hm2_diag *diag);
/* Refuse (HM2_ERR_STATE) when somebody else talks to the card: packet counters that move by themselves for 100 ms, or a
 * signature in its scratch register that does not stay (H10, H11). Takes 100 ms, and nothing when it was found a second
 * ago and nobody has turned up since. */
HM2_API int HM2_MUST_CHECK flash_card_quiet(struct flash_card *card, struct hm2_diag *diag);
/* Number of I/O pins that are outputs now (H19); negative = error. */
HM2_API int HM2_MUST_CHECK flash_card_outputs(struct flash_card *card, struct hm2_diag *diag);

/* What a smart-serial port says of itself, and what each remote at it does. */
struct flash_sserial {
    uint8_t type, width, major, minor, first, stride, processor, channels; /* local parameters 0 to 7 */
    uint32_t baud, clock_hz;
};

struct flash_remote {
    unsigned channel;
    uint32_t unit;
    char name[5];                      /* printable */
    struct sslbp_tables tables;        /* as sslbp_list() fills them */
    uint64_t values[SSLBP_GLOBAL_MAX]; /* of tables.global */
    bool known[SSLBP_GLOBAL_MAX];      /* the value could be read */
};

/* Ask a port: the function is called with remote = NULL first, then for each remote that answers. The port is reset and
 * its pins are switched to it meanwhile, and given back afterwards: refuse before (see flash_card_quiet()) when a
 * machine may run. HM2_ERR_NOTFOUND, without a sentence, when there is no such port. */
typedef void (*flash_sserial_fn)(void *context, const struct flash_sserial *port, const struct flash_remote *remote);
HM2_API int HM2_MUST_CHECK flash_card_sserial(struct flash_card *card, unsigned port, flash_sserial_fn each,
                                              void *context, struct hm2_diag *diag);

/* Any memory space of 16-bit items, and HostMot2's registers. */
HM2_API int HM2_MUST_CHECK flash_card_read16(struct flash_card *card, enum lbp16_space space, uint16_t address,
                                             unsigned count, uint16_t *words, struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK flash_card_read_hm2(struct flash_card *card, uint16_t address, unsigned count,
                                               uint32_t *words, struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK flash_card_write_hm2(struct flash_card *card, uint16_t address, unsigned count,
                                                const uint32_t *words, struct hm2_diag *diag);
/* Write settings and read them back, in the same datagram and in another one; at most 16 words in the range
 * LBP16_EEPROM_IP and up. HM2_ERR_IO when they differ. */
HM2_API int HM2_MUST_CHECK flash_card_write_eeprom(struct flash_card *card, uint16_t address, unsigned count,
                                                   const uint16_t *words, struct hm2_diag *diag);
/* Bytes of the flash; any number from any address divisible by 4. */
HM2_API int HM2_MUST_CHECK flash_card_read(struct flash_card *card, uint32_t address, uint8_t *bytes, size_t count,
                                           struct hm2_diag *diag);

/* Start the FPGA again from an area (firmware 15 and newer), or restart the card's LBP16 firmware; no reply comes.
 * flash_card_await() then asks until the card is back, at most limit_ns, and reads everything about it anew. */
HM2_API int HM2_MUST_CHECK flash_card_reload(struct flash_card *card, enum flash_area area, struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK flash_card_reset(struct flash_card *card, struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK flash_card_await(struct flash_card *card, int64_t limit_ns, struct hm2_diag *diag);

/* ---- jobs: compare, erase, write, verify, back up, restore ------------------------------------------------------- */

enum flash_phase { FLASH_COMPARING, FLASH_ERASING, FLASH_WRITING, FLASH_VERIFYING, FLASH_READING, FLASH_DONE };

struct flash_progress {
    enum flash_phase phase;
    unsigned done, total; /* of this phase: sectors when erasing, else pages */
    uint64_t bytes_done, bytes_total;
    uint32_t address;
};

struct flash_options {
    enum flash_area area;
    const char *file_name;    /* of the image, for the rules about names; NULL = unknown */
    const char *known_card;   /* that a list of known images says the image is for; NULL = none does */
    const char *override;     /* this card's name: take an image although nothing says that it is for this card, or
                                 something says otherwise (H3, H4). Never helps against another FPGA */
    bool confirmed;           /* the fallback area or the boot block may be written (H4, H6) */
    bool fix_boot_block;      /* repair a missing boot block (H7) */
    bool no_verify;           /* do not read back */
    unsigned pages_per_write; /* most pages in a datagram, 1..5; 0 = 5 */
    bool any_traffic;         /* do not look for other programs on the card; for cards that are known to be idle */
};

struct flash_job;

/* Everything that can be refused is refused here, before anything is changed: card and image are checked against each
 * other, the card's flash is looked at. The image and its data, the card and the strings must outlive the job. */
HM2_API int HM2_MUST_CHECK flash_job_write(struct flash_job **job, struct flash_card *card,
                                           const struct flash_image *image, const struct flash_options *options,
                                           struct hm2_diag *diag);
/* The same without writing: is this image in that area? Like all jobs it is refused while somebody else uses the card
 * (HM2_ERR_STATE; see flash_card_quiet()), and ends when somebody begins to: long replies would delay a driver's. */
HM2_API int HM2_MUST_CHECK flash_job_verify(struct flash_job **job, struct flash_card *card,
                                            const struct flash_image *image, const struct flash_options *options,
                                            struct hm2_diag *diag);
/* A dump of the whole chip: compared, or written (user area, fallback area, boot block; never two of them at once). */
HM2_API int HM2_MUST_CHECK flash_job_verify_dump(struct flash_job **job, struct flash_card *card, const uint8_t *dump,
                                                 size_t len, const struct flash_options *options,
                                                 struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK flash_job_restore(struct flash_job **job, struct flash_card *card, const uint8_t *dump,
                                             size_t len, const struct flash_options *options, struct hm2_diag *diag);
/* Read the whole chip into the caller's memory, of the chip's size. */
HM2_API int HM2_MUST_CHECK flash_job_backup(struct flash_job **job, struct flash_card *card, uint8_t *dump, size_t len,
                                            const struct flash_options *options, struct hm2_diag *diag);
HM2_API void flash_job_free(struct flash_job *job);

/* One step: a datagram's worth of work with its tries, sixteen of them when only reading, or one erase. 1 = go on, 0 =
 * done, or an error. Between two steps a caller may stop: see flash_job_between_sectors(). */
HM2_API int HM2_MUST_CHECK flash_job_step(struct flash_job *job, struct hm2_diag *diag);
/* All steps; progress (may be NULL) is called after each and returns false to stop, which happens when no sector is
 * half written: HM2_ERR_STATE when nothing was changed yet, else HM2_ERR_IO. */
typedef bool (*flash_progress_fn)(void *context, const struct flash_progress *progress);
HM2_API int HM2_MUST_CHECK flash_job_run(struct flash_job *job, flash_progress_fn progress, void *context,
                                         struct hm2_diag *diag);
HM2_API struct flash_progress flash_job_progress(const struct flash_job *job);
/* No sector is erased and not yet written again, but those that this job has not come to: a good moment to stop. */
HM2_API bool flash_job_between_sectors(const struct flash_job *job);

/* What is to be done; complete once the phase is no longer FLASH_COMPARING. */
enum flash_sector_state { FLASH_SECTOR_UNSEEN, FLASH_SECTOR_SAME, FLASH_SECTOR_WRITE, FLASH_SECTOR_ERASE };
struct flash_plan {
    struct flash_range range;          /* nothing outside is touched */
    unsigned sectors;                  /* that the data touch */
    uint8_t state[FLASH_MAX_SECTORS];  /* enum flash_sector_state, by sector of the chip */
    unsigned same, to_write, to_erase; /* sectors; to_erase are among to_write */
    unsigned pages;                    /* to be written */
    bool boot_block;                   /* will be installed */
};
HM2_API const struct flash_plan *flash_job_plan(const struct flash_job *job);

/* The first difference that a verify found. */
struct flash_difference {
    bool found;
    uint32_t address;
    uint8_t expected, read;
};
HM2_API struct flash_difference flash_job_difference(const struct flash_job *job);

#endif
