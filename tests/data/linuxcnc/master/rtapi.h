/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Compile-only model of LinuxCNC master's rtapi.h: the calls that 2.9 has, too. See ../README.md. */
#ifndef MODEL_RTAPI_H
#define MODEL_RTAPI_H

#ifndef RTAPI
#error "components are compiled with -DRTAPI"
#endif

#include <stdarg.h>

typedef enum {
    RTAPI_MSG_NONE = 0,
    RTAPI_MSG_ERR = 1,
    RTAPI_MSG_WARN = 2,
    RTAPI_MSG_INFO = 3,
    RTAPI_MSG_DBG = 4,
    RTAPI_MSG_ALL = 5
} msg_level_t;

void rtapi_print(const char *format, ...) __attribute__((format(printf, 1, 2)));
void rtapi_print_msg(msg_level_t level, const char *format, ...) __attribute__((format(printf, 2, 3)));
int rtapi_set_msg_level(int level);
int rtapi_get_msg_level(void);
int rtapi_snprintf(char *text, unsigned long size, const char *format, ...) __attribute__((format(printf, 3, 4)));
int rtapi_vsnprintf(char *text, unsigned long size, const char *format, va_list args);
long long rtapi_get_time(void);
void rtapi_delay(long ns);
int rtapi_task_self(void);

/* Variables by name, and the names that the linker is to show (hal-interface 5.5). */
#define EXPORT_SYMBOL(name)              \
    extern char rtapi_exported_##name[]; \
    __attribute__((section(".rtapi_export"))) char rtapi_exported_##name[] = #name
#define MODEL_INFO(type, name, value) \
    extern type rtapi_info_##name;    \
    type rtapi_info_##name = value;   \
    EXPORT_SYMBOL(rtapi_info_##name)
#define MODULE_LICENSE(text)     MODEL_INFO(const char *, license, text)
#define MODULE_AUTHOR(text)      MODEL_INFO(const char *, author, text)
#define MODULE_DESCRIPTION(text) MODEL_INFO(const char *, description, text)
#define MODEL_PARAMETER(name, code, address, text) \
    MODEL_INFO(const char *, type_##name, code);   \
    MODEL_INFO(void *, address_##name, address);   \
    MODEL_INFO(const char *, description_##name, text)
#define MODEL_ARRAY(name, count, code, text) \
    MODEL_INFO(int, size_##name, count);     \
    MODEL_PARAMETER(name, code, name, text)
#define RTAPI_MP_INT(name, text)                 MODEL_PARAMETER(name, "i", &name, text)
#define RTAPI_MP_LONG(name, text)                MODEL_PARAMETER(name, "l", &name, text)
#define RTAPI_MP_STRING(name, text)              MODEL_PARAMETER(name, "s", &name, text)
#define RTAPI_MP_ARRAY_INT(name, count, text)    MODEL_ARRAY(name, count, "i", text)
#define RTAPI_MP_ARRAY_LONG(name, count, text)   MODEL_ARRAY(name, count, "l", text)
#define RTAPI_MP_ARRAY_STRING(name, count, text) MODEL_ARRAY(name, count, "s", text)

#endif
