/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A binder without a host. Objects, names and the structs of modules live in blocks that are never moved or shrunk;
 * a hash table (open addressing, at most half full) leads from names and aliases to objects.
 */
#include <hm2/points.h>

#include <stdalign.h>
#include <stdlib.h>
#include <string.h>

#define BLOCK_BYTES 16384u
#define FIRST_SLOTS 256u /* a power of two, like every size of the hash table */

union value {
    hm2_bit_t b;
    hm2_s32_t s;
    hm2_u32_t u;
    hm2_float_t f;
};

struct block {
    struct block *next;
    size_t used, capacity;
    alignas(max_align_t) unsigned char bytes[];
};

struct entry {
    const char *name; /* NULL = free */
    struct hm2_plain_object *object;
};

struct hm2_plain_binder {
    struct hm2_binder binder; /* first: the callbacks get a pointer to it */
    struct block *blocks;
    struct hm2_plain_object **objects; /* in order of creation */
    size_t count, capacity;
    struct entry *slots;
    size_t slot_count, slots_used;
};

static void *take(struct hm2_plain_binder *const plain, size_t size)
{
    const size_t align = alignof(max_align_t);
    if (size > SIZE_MAX - BLOCK_BYTES)
        return NULL;
    size = (size + align - 1) / align * align;
    if (!plain->blocks || plain->blocks->capacity - plain->blocks->used < size) {
        const size_t capacity = size > BLOCK_BYTES ? size : BLOCK_BYTES;
        struct block *const fresh = calloc(1, sizeof *fresh + capacity);
        if (!fresh)
            return NULL;
        fresh->capacity = capacity;
        fresh->next = plain->blocks;
        plain->blocks = fresh;
    }
    void *const memory = plain->blocks->bytes + plain->blocks->used;
    plain->blocks->used += size;
    return memory;
}

static char *keep_text(struct hm2_plain_binder *const plain, const char *const text)
{
    const size_t size = strlen(text) + 1;
    char *const copy = take(plain, size);
    return copy ? memcpy(copy, text, size) : NULL;
}

/* FNV-1a. */
static size_t hash(const char *text)
{
    uint64_t h = 0xcbf29ce484222325u;
    for (; *text; text++)
        h = (h ^ (unsigned char)*text) * 0x100000001b3u;
    return (size_t)(h ^ h >> 32);
}

/* The entry of a name, or the free one where it belongs. */
static struct entry *locate(struct entry *const slots, const size_t slot_count, const char *const name)
{
    size_t at = hash(name) & (slot_count - 1);
    while (slots[at].name && strcmp(slots[at].name, name) != 0)
        at = (at + 1) & (slot_count - 1);
    return &slots[at];
}

static bool grow_slots(struct hm2_plain_binder *const plain)
{
    if (plain->slots && plain->slots_used < plain->slot_count / 2)
        return true;
    const size_t wanted = plain->slots ? plain->slot_count * 2 : FIRST_SLOTS;
    struct entry *const fresh = calloc(wanted, sizeof *fresh);
    if (!fresh)
        return false;
    for (size_t i = 0; i < plain->slot_count; i++)
        if (plain->slots[i].name)
            *locate(fresh, wanted, plain->slots[i].name) = plain->slots[i];
    free(plain->slots);
    plain->slots = fresh;
    plain->slot_count = wanted;
    return true;
}

static bool grow_objects(struct hm2_plain_binder *const plain)
{
    if (plain->count < plain->capacity)
        return true;
    const size_t wanted = plain->capacity ? plain->capacity * 2 : 128;
    struct hm2_plain_object **const fresh = realloc(plain->objects, wanted * sizeof(void *));
    if (!fresh)
        return false;
    plain->objects = fresh;
    plain->capacity = wanted;
    return true;
}

static void enter(struct hm2_plain_binder *const plain, const char *const name, struct hm2_plain_object *const object)
{
    *locate(plain->slots, plain->slot_count, name) = (struct entry){name, object};
    plain->slots_used++;
}

static void *plain_alloc(struct hm2_binder *const binder, const size_t size)
{
    return take((struct hm2_plain_binder *)binder, size);
}

static bool is_empty(const void *const slot)
{
    const void *const empty = NULL;
    return memcmp(slot, &empty, sizeof empty) == 0;
}

static int plain_create(struct hm2_binder *const binder, const char *const full_name,
                        const struct hm2_point *const point, void *const slot, struct hm2_diag *const diag)
{
    struct hm2_plain_binder *const plain = (struct hm2_plain_binder *)binder;
    if (strlen(full_name) >= HM2_NAME_SIZE)
        return hm2_diag_add(diag, HM2_ERR_HOST, "the name %.40s... is longer than %u characters", full_name,
                            HM2_NAME_SIZE - 1);
    if (hm2_plain_find(plain, full_name))
        return hm2_diag_add(diag, HM2_ERR_HOST, "%s exists already", full_name);
    if (!is_empty(slot))
        return hm2_diag_add(diag, HM2_ERR_HOST, "%s: its pointer is in use", full_name);
    struct hm2_plain_object *const object = take(plain, sizeof *object);
    union value *const value = take(plain, sizeof *value);
    const char *const name = keep_text(plain, full_name);
    if (!object || !value || !name || !grow_slots(plain) || !grow_objects(plain))
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for %s", full_name);
    *object = (struct hm2_plain_object){.name = name, .point = point, .value = value};
    plain->objects[plain->count++] = object;
    enter(plain, name, object);
    const void *const pointer = value;
    memcpy(slot, &pointer, sizeof pointer);
    return 0;
}

static int plain_alias(struct hm2_binder *const binder, const char *const existing, const char *const alias)
{
    struct hm2_plain_binder *const plain = (struct hm2_plain_binder *)binder;
    const struct hm2_plain_object *const found = hm2_plain_find(plain, existing);
    if (!found || found->alias || strlen(alias) >= HM2_NAME_SIZE || hm2_plain_find(plain, alias))
        return HM2_ERR_HOST;
    const char *const name = keep_text(plain, alias);
    if (!name || !grow_slots(plain))
        return HM2_ERR_NOMEM;
    struct hm2_plain_object *const object = locate(plain->slots, plain->slot_count, existing)->object;
    object->alias = name;
    enter(plain, name, object);
    return 0;
}

struct hm2_plain_binder *hm2_plain_binder_new(void)
{
    struct hm2_plain_binder *const plain = calloc(1, sizeof *plain);
    if (plain)
        plain->binder = (struct hm2_binder){.alloc = plain_alloc, .create = plain_create, .alias = plain_alias};
    return plain;
}

void hm2_plain_binder_free(struct hm2_plain_binder *const plain)
{
    if (!plain)
        return;
    for (struct block *block = plain->blocks; block;) {
        struct block *const next = block->next;
        free(block);
        block = next;
    }
    free(plain->objects);
    free(plain->slots);
    free(plain);
}

struct hm2_binder *hm2_plain_binder(struct hm2_plain_binder *const plain)
{
    return &plain->binder;
}

const struct hm2_plain_object *hm2_plain_find(const struct hm2_plain_binder *const plain, const char *const name)
{
    return plain->slots ? locate(plain->slots, plain->slot_count, name)->object : NULL;
}

size_t hm2_plain_count(const struct hm2_plain_binder *const plain)
{
    return plain->count;
}

const struct hm2_plain_object *hm2_plain_at(const struct hm2_plain_binder *const plain, const size_t index)
{
    return index < plain->count ? plain->objects[index] : NULL;
}

double hm2_plain_get(const struct hm2_plain_binder *const plain, const char *const name, int *const err)
{
    const struct hm2_plain_object *const object = hm2_plain_find(plain, name);
    if (err)
        *err = object ? 0 : HM2_ERR_NOTFOUND;
    return object ? hm2_point_load(object->point->type, object->value) : 0.0;
}

int hm2_plain_set(struct hm2_plain_binder *const plain, const char *const name, const double value)
{
    const struct hm2_plain_object *const object = hm2_plain_find(plain, name);
    if (!object)
        return HM2_ERR_NOTFOUND;
    hm2_point_store(object->point->type, object->value, value);
    return 0;
}
