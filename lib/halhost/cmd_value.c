/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Values and types by name. */
#include "commands.h"

static int no_object(const char *const name, struct hm2_diag *const diag)
{
    return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no parameter or pin '%s'", name);
}

/* Where setp may store, or NULL with the reason. */
static volatile void *writable(const struct hal_object *const object, const char *const name,
                               struct hm2_diag *const diag)
{
    if (object->param && object->param->dir != HAL_RO)
        return object->param->value;
    if (object->param)
        hm2_diag_add(diag, HM2_ERR_STATE, "parameter '%s' is not writable", name);
    else if (object->pin->dir == HAL_OUT)
        hm2_diag_add(diag, HM2_ERR_STATE, "pin '%s' is an output, it is not writable", name);
    else if (object->pin->signal)
        hm2_diag_add(diag, HM2_ERR_STATE, "pin '%s' is linked to signal '%s': set that with sets", name,
                     object->pin->signal->names.name);
    else
        return object->pin->own;
    return NULL;
}

static int run_setp(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    struct hal_object object;
    if (hh_host()->lock & HAL_LOCK_PARAMS)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: nothing is set now");
    if (!hal_find_object(args[0], &object))
        return no_object(args[0], diag);
    volatile void *const address = writable(&object, args[0], diag);
    if (!address)
        return HM2_ERR_STATE;
    struct hh_value value;
    const int err = hh_parse(object.type, args[1], &value, diag);
    if (!err)
        hh_store(address, value);
    return err;
}

static int run_sets(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    const struct hh_signal *const signal = hh_table_find(&hh_host()->signals, args[0]);
    if (hh_host()->lock & HAL_LOCK_PARAMS)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: nothing is set now");
    if (!signal)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no signal '%s'", args[0]);
    if (signal->writers > 0)
        return hm2_diag_add(diag, HM2_ERR_STATE, "signal '%s' is driven by an output pin", args[0]);
    struct hh_value value;
    const int err = hh_parse(signal->type, args[1], &value, diag);
    if (!err)
        hh_store(signal->value, value);
    return err;
}

static void print_value(struct hal_session *const session, const struct hh_value value)
{
    char text[HH_VALUE_TEXT];
    hh_format_plain(value, text);
    hal_print(session, "%s\n", text);
}

static int run_getp(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)count;
    struct hal_object object;
    if (!hal_find_object(args[0], &object))
        return no_object(args[0], diag);
    print_value(session, hal_object_value(&object));
    return 0;
}

static int run_gets(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)count;
    const struct hh_signal *const signal = hh_table_find(&hh_host()->signals, args[0]);
    if (!signal)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no signal '%s'", args[0]);
    print_value(session, hh_load(signal->type, signal->value));
    return 0;
}

static int run_ptype(struct hal_session *const session, char *const *const args, const size_t count,
                     struct hm2_diag *const diag)
{
    (void)count;
    struct hal_object object;
    if (!hal_find_object(args[0], &object))
        return no_object(args[0], diag);
    hal_print(session, "%s\n", hh_type_name(object.type));
    return 0;
}

static int run_stype(struct hal_session *const session, char *const *const args, const size_t count,
                     struct hm2_diag *const diag)
{
    (void)count;
    const struct hh_signal *const signal = hh_table_find(&hh_host()->signals, args[0]);
    if (!signal)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no signal '%s'", args[0]);
    hal_print(session, "%s\n", hh_type_name(signal->type));
    return 0;
}

const struct hal_command hal_value_commands[] = {
    {"setp", 2, 2, run_setp, "NAME VALUE", "set a parameter or an unlinked input pin; also: NAME = VALUE", "P-", false},
    {"sets", 2, 2, run_sets, "SIGNAL VALUE", "set a signal that no output pin drives", "s-", false},
    {"getp", 1, 1, run_getp, "NAME", "print the value of a parameter or pin", "P", false},
    {"gets", 1, 1, run_gets, "SIGNAL", "print the value of a signal", "s", false},
    {"ptype", 1, 1, run_ptype, "NAME", "print the type of a parameter or pin", "P", false},
    {"stype", 1, 1, run_stype, "SIGNAL", "print the type of a signal", "s", false},
    {NULL, 0, 0, NULL, NULL, NULL, NULL, false},
};
