/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/points.h>

#include <stdio.h>
#include <string.h>

#include <hm2/number.h>

void hm2_point_store(const enum hm2_point_type type, void *const value, const double number)
{
    switch (type) {
    case HM2_BIT:
        *(hm2_bit_t *)value = number != 0.0;
        break;
    case HM2_S32:
        *(hm2_s32_t *)value = hm2_trunc_s32(number);
        break;
    case HM2_U32:
        *(hm2_u32_t *)value = hm2_trunc_u32(number);
        break;
    case HM2_FLOAT:
        *(hm2_float_t *)value = number;
        break;
    }
}

double hm2_point_load(const enum hm2_point_type type, const void *const value)
{
    switch (type) {
    case HM2_BIT:
        return *(const hm2_bit_t *)value ? 1.0 : 0.0;
    case HM2_S32:
        return (double)*(const hm2_s32_t *)value;
    case HM2_U32:
        return (double)*(const hm2_u32_t *)value;
    case HM2_FLOAT:
        return *(const hm2_float_t *)value;
    }
    return 0.0;
}

/* Write prefix.name with the runs of '#' replaced by the index. Returns false when it does not fit. */
static bool full_name(char out[HM2_NAME_SIZE], const char *const prefix, const char *name, const unsigned index)
{
    int len = snprintf(out, HM2_NAME_SIZE, "%s.", prefix);
    while (len >= 0 && (size_t)len < HM2_NAME_SIZE && *name) {
        const size_t plain = strcspn(name, "#");
        const size_t hashes = strspn(name + plain, "#");
        const size_t room = HM2_NAME_SIZE - (size_t)len;
        const int added = hashes ? snprintf(out + len, room, "%.*s%0*u", (int)plain, name, (int)hashes, index)
                                 : snprintf(out + len, room, "%s", name);
        if (added < 0)
            return false;
        len += added;
        name += plain + hashes;
    }
    return len >= 0 && (size_t)len < HM2_NAME_SIZE;
}

int hm2_bind_points(struct hm2_binder *const binder, const struct hm2_point *const points, const size_t count,
                    void *const base, const char *const prefix, const unsigned index, struct hm2_diag *const diag)
{
    for (size_t i = 0; i < count; i++) {
        const struct hm2_point *const point = &points[i];
        void *const slot = (unsigned char *)base + point->offset;
        char name[HM2_NAME_SIZE];
        if (!full_name(name, prefix, point->name, index))
            return hm2_diag_add(diag, HM2_ERR_NOSPACE, "the name %s... is longer than %u characters", name,
                                HM2_NAME_SIZE - 1);
        const int err = binder->create(binder, name, point, slot, diag);
        if (err < 0)
            return err;
        void *value;
        memcpy(&value, slot, sizeof value);
        hm2_point_store(point->type, value, point->initial);
    }
    return 0;
}
