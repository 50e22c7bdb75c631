/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Components from files and built-in ones: finding, parameters, life. */
#include "state.h"

#include <ctype.h>
#include <dirent.h>
#include <dlfcn.h>
#include <elf.h>
#include <errno.h>
#include <limits.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "parameters.h"

struct hh_module {
    char name[HH_NAME_SIZE];
    char *arguments; /* as given, for `save` */
    void *handle;    /* NULL = built in */
    void *block;     /* parameters of a built-in one */
    const struct halhost_builtin *builtin;
    int (*main)(void);
    void (*exit)(void);
    struct hh_parameters parameters;
};

const char *hh_module_name(const struct hh_module *const module)
{
    return module->name;
}

const char *hh_module_arguments(const struct hh_module *const module)
{
    return module->arguments;
}

static struct hh_module *module_find(const struct hh *const host, const char *const name)
{
    for (size_t i = 0; i < host->modules.count; i++) {
        struct hh_module *const module = host->modules.items[i];
        if (strcmp(module->name, name) == 0)
            return module;
    }
    return NULL;
}

/* ---- finding ---------------------------------------------------------------------------------------------------- */

static int check_module_name(const char *const name, struct hm2_diag *const diag)
{
    const int err = hh_check_name("component", name, diag);
    if (err)
        return err;
    for (size_t i = 0; name[i]; i++) {
        if (!isalnum((unsigned char)name[i]) && name[i] != '_' && name[i] != '-' && name[i] != '+')
            return hm2_diag_add(diag, HM2_ERR_INVALID, "'%s' cannot be the name of a component", name);
    }
    return 0;
}

static const struct halhost_builtin *find_builtin(const struct hh *const host, const char *const name)
{
    for (size_t i = 0; i < host->options.builtin_count; i++) {
        if (strcmp(host->options.builtins[i].name, name) == 0)
            return &host->options.builtins[i];
    }
    return strcmp(hh_threads_builtin.name, name) == 0 ? &hh_threads_builtin : NULL;
}

static int open_file(const struct hh *const host, struct hh_module *const module, struct hm2_diag *const diag)
{
    char path[PATH_MAX], looked[1024] = "";
    size_t used = 0;
    for (const char *const *folder = host->options.folders; folder && *folder; folder++) {
        const int length = snprintf(path, sizeof path, "%s/%s.so", *folder, module->name);
        if (length < 0 || (size_t)length >= sizeof path)
            continue;
        if (access(path, R_OK) == 0) {
            module->handle = dlopen(path, RTLD_NOW | RTLD_GLOBAL);
            return module->handle ? 0 : hm2_diag_add(diag, HM2_ERR_HOST, "cannot load %s: %s", path, dlerror());
        }
        const int more = snprintf(looked + used, sizeof looked - used, "%s%s", used ? ", " : "", *folder);
        used = more > 0 && used + (size_t)more < sizeof looked ? used + (size_t)more : used;
    }
    return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no component '%s' (looked for %s.so in %s)", module->name,
                        module->name, used ? looked : "no folder");
}

/* Every symbol a module defines. Its dynamic section is all that the C library shows of it at run time. */
struct symbols {
    const ElfW(Sym) * table;
    const char *strings;
    size_t count;
};

/* Number of symbols from a GNU hash table: the end of the last chain. */
static size_t count_gnu_hash(const uint32_t *const hash)
{
    const uint32_t buckets = hash[0], first = hash[1], bloom_words = hash[2];
    const uint32_t *const bucket = hash + 4 + bloom_words * (sizeof(ElfW(Addr)) / sizeof(uint32_t));
    const uint32_t *const chain = bucket + buckets;
    uint32_t last = 0;
    for (uint32_t i = 0; i < buckets; i++)
        last = bucket[i] > last ? bucket[i] : last;
    if (last < first)
        return first;
    while (!(chain[last - first] & 1u))
        last++;
    return (size_t)last + 1;
}

static struct symbols symbols_of(void *const handle)
{
    struct symbols symbols = {0};
    struct link_map *map = NULL;
    if (dlinfo(handle, RTLD_DI_LINKMAP, &map) || !map)
        return symbols;
    for (const ElfW(Dyn) *dynamic = map->l_ld; dynamic->d_tag != DT_NULL; dynamic++) {
        /* Addresses are relocated on most machines only. */
        const ElfW(Addr) address =
            dynamic->d_un.d_ptr < map->l_addr ? dynamic->d_un.d_ptr + map->l_addr : dynamic->d_un.d_ptr;
        if (dynamic->d_tag == DT_SYMTAB)
            symbols.table = (const ElfW(Sym) *)address;
        else if (dynamic->d_tag == DT_STRTAB)
            symbols.strings = (const char *)address;
        else if (dynamic->d_tag == DT_GNU_HASH)
            symbols.count = count_gnu_hash((const uint32_t *)address);
        else if (dynamic->d_tag == DT_HASH)
            symbols.count = ((const uint32_t *)address)[1];
    }
    if (!symbols.table || !symbols.strings)
        symbols.count = 0;
    return symbols;
}

static const void *info(void *const handle, const char *const kind, const char *const name)
{
    char symbol[HH_PARAMETER_NAME_SIZE + 32];
    (void)snprintf(symbol, sizeof symbol, "rtapi_info_%s_%s", kind, name);
    return dlsym(handle, symbol);
}

/* hal-interface 5.5 */
static int collect_parameters(struct hh_module *const module, struct hm2_diag *const diag)
{
    static const char prefix[] = "rtapi_info_address_";
    const struct symbols symbols = symbols_of(module->handle);
    for (size_t i = 0; i < symbols.count; i++) {
        const char *const symbol = symbols.strings + symbols.table[i].st_name;
        if (symbols.table[i].st_shndx == SHN_UNDEF || strncmp(symbol, prefix, sizeof prefix - 1) != 0)
            continue;
        const char *const name = symbol + sizeof prefix - 1;
        void *const *const address = info(module->handle, "address", name);
        const char *const *const type = info(module->handle, "type", name);
        const int *const elements = info(module->handle, "size", name);
        if (!address || !*address || !type || !*type)
            continue;
        const int err =
            hh_parameters_add(&module->parameters, name, (*type)[0], *address, elements ? *elements : 0, diag);
        if (err)
            return err;
    }
    return 0;
}

static int prepare_file(const struct hh *const host, struct hh_module *const module, struct hm2_diag *const diag)
{
    const int err = open_file(host, module, diag);
    if (err)
        return err;
    /* POSIX wants dlsym()'s result to be usable as a function; ISO C has no cast for it. */
    *(void **)&module->main = dlsym(module->handle, "rtapi_app_main");
    *(void **)&module->exit = dlsym(module->handle, "rtapi_app_exit");
    if (!module->main)
        return hm2_diag_add(diag, HM2_ERR_HOST, "component '%s' has no rtapi_app_main", module->name);
    return collect_parameters(module, diag);
}

static int prepare_builtin(struct hh_module *const module, struct hm2_diag *const diag)
{
    const struct halhost_builtin *const builtin = module->builtin;
    module->block = calloc(1, builtin->block_size ? builtin->block_size : 1);
    if (!module->block)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for component '%s'", module->name);
    if (builtin->defaults)
        memcpy(module->block, builtin->defaults, builtin->block_size);
    for (size_t i = 0; i < builtin->parameter_count; i++) {
        const struct halhost_parameter *const parameter = &builtin->parameters[i];
        const int err = hh_parameters_add(&module->parameters, parameter->name, parameter->type,
                                          (char *)module->block + parameter->offset, parameter->elements, diag);
        if (err)
            return err;
    }
    return 0;
}

/* ---- life ------------------------------------------------------------------------------------------------------- */

static void module_free(struct hh_module *const module)
{
    if (module->handle)
        (void)dlclose(module->handle);
    hh_parameters_free(&module->parameters);
    free(module->block);
    free(module->arguments);
    free(module);
}

/* Components that the module's own clean-up has left. */
static int remove_comps(struct hh *const host, const struct hh_module *const module, struct hm2_diag *const diag)
{
    int err = 0;
    for (size_t i = host->comps.count; i-- > 0 && !err;) {
        struct hh_comp *const comp = host->comps.items[i];
        if (comp->module == module)
            err = hh_comp_remove(host, comp, diag);
    }
    return err;
}

static int check_ready(const struct hh *const host, const struct hh_module *const module, struct hm2_diag *const diag)
{
    for (size_t i = 0; i < host->comps.count; i++) {
        const struct hh_comp *const comp = host->comps.items[i];
        if (comp->module == module && !comp->ready)
            return hm2_diag_add(diag, HM2_ERR_HOST, "component '%s' did not call hal_ready", comp->name);
    }
    return 0;
}

static void call_exit(const struct hh_module *const module)
{
    if (module->builtin && module->builtin->exit)
        module->builtin->exit(module->block);
    else if (module->exit)
        module->exit();
}

static int run_main(struct hh *const host, struct hh_module *const module, struct hm2_diag *const diag)
{
    host->loading = module;
    const int result = module->builtin ? module->builtin->main(module->block) : module->main();
    host->loading = NULL;
    if (result < 0)
        return hm2_diag_add(diag, HM2_ERR_HOST, "component '%s' refused to load: error %d (%s)", module->name, result,
                            strerror(-result));
    const int err = check_ready(host, module, diag);
    if (err)
        call_exit(module);
    return err;
}

static int keep_arguments(struct hh_module *const module, const char *const *const arguments, const size_t count)
{
    size_t length = 1;
    for (size_t i = 0; i < count; i++)
        length += strlen(arguments[i]) + 1;
    module->arguments = malloc(length);
    if (!module->arguments)
        return HM2_ERR_NOMEM;
    char *to = module->arguments;
    for (size_t i = 0; i < count; i++)
        to += snprintf(to, length - (size_t)(to - module->arguments), "%s ", arguments[i]);
    *to = '\0';
    return 0;
}

static int load(struct hh *const host, struct hh_module *const module, const char *const *const arguments,
                const size_t count, struct hm2_diag *const diag)
{
    module->builtin = find_builtin(host, module->name);
    int err = module->builtin ? prepare_builtin(module, diag) : prepare_file(host, module, diag);
    if (!err)
        err = keep_arguments(module, arguments, count);
    for (size_t i = 0; i < count && !err; i++)
        err = hh_parameters_set(&module->parameters, module->name, arguments[i], diag);
    if (!err && hh_list_insert(&host->modules, host->modules.count, module))
        err = hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for component '%s'", module->name);
    if (err)
        return err;
    err = run_main(host, module, diag);
    if (err) {
        hh_list_remove(&host->modules, module);
        if (remove_comps(host, module, diag))
            module->handle = NULL; /* a thread may still be in its code: leave it mapped */
    }
    return err;
}

int halhost_load(const char *const name, const char *const *const arguments, const size_t count,
                 struct hm2_diag *const diag)
{
    struct hh *const host = hh_host();
    if (!host)
        return hm2_diag_add(diag, HM2_ERR_STATE, "there is no HAL host");
    if (host->lock & HAL_LOCK_LOAD)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no components are loaded now");
    int err = check_module_name(name, diag);
    if (err)
        return err;
    if (module_find(host, name))
        return hm2_diag_add(diag, HM2_ERR_STATE, "component '%s' is loaded already", name);
    struct hh_module *const module = calloc(1, sizeof *module);
    if (!module)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for component '%s'", name);
    memcpy(module->name, name, strlen(name) + 1);
    err = load(host, module, arguments, count, diag);
    if (err)
        module_free(module);
    return err;
}

static int unload(struct hh *const host, struct hh_module *const module, struct hm2_diag *const diag)
{
    /* First take its functions out of the threads, so that its exit may free what they use. */
    int err = 0;
    for (size_t i = 0; i < host->comps.count && !err; i++) {
        const struct hh_comp *const comp = host->comps.items[i];
        if (comp->module == module)
            err = hh_functs_remove(host, comp, diag);
    }
    if (err)
        return err;
    call_exit(module);
    err = remove_comps(host, module, diag);
    if (err)
        return err;
    hh_list_remove(&host->modules, module);
    module_free(module);
    return 0;
}

int halhost_unload(const char *const name, struct hm2_diag *const diag)
{
    struct hh *const host = hh_host();
    if (host && host->lock & HAL_LOCK_LOAD)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no components are unloaded now");
    struct hh_module *const module = host ? module_find(host, name) : NULL;
    return module ? unload(host, module, diag)
                  : hm2_diag_add(diag, HM2_ERR_NOTFOUND, "component '%s' is not loaded", name);
}

int halhost_unload_all(struct hm2_diag *const diag)
{
    struct hh *const host = hh_host();
    int err = 0;
    while (host && host->modules.count > 0 && !err)
        err = unload(host, host->modules.items[host->modules.count - 1], diag);
    return err;
}

/* ---- what could be loaded, for completion ------------------------------------------------------------------------ */

const char *hh_loadable(size_t index, char *const name, const size_t size)
{
    const struct hh *const host = hh_host();
    if (index == 0)
        return hh_threads_builtin.name;
    index--;
    if (index < host->options.builtin_count)
        return host->options.builtins[index].name;
    index -= host->options.builtin_count;
    for (const char *const *folder = host->options.folders; folder && *folder; folder++) {
        DIR *const entries = opendir(*folder);
        for (const struct dirent *entry; entries && (entry = readdir(entries));) {
            const char *const dot = strrchr(entry->d_name, '.');
            const size_t length = dot ? (size_t)(dot - entry->d_name) : 0;
            if (!dot || strcmp(dot, ".so") != 0 || length >= size || index-- > 0)
                continue;
            memcpy(name, entry->d_name, length);
            name[length] = '\0';
            (void)closedir(entries);
            return name;
        }
        if (entries)
            (void)closedir(entries);
    }
    return NULL;
}
