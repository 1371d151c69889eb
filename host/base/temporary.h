/*
 * The temporary files of the process that have a name now, so that a signal handler that ends it
 * can remove them: ovoid_remove_temporaries(). A table without locks, for a handler cannot wait for
 * the thread that it interrupts.
 */
#ifndef OV_TEMPORARY_H
#define OV_TEMPORARY_H

/* Takes note of a path, which must stay until ov_temporary_end(). NULL is fine. */
void ov_temporary_begin(const char *path);

/* Forgets a path, which was removed or has another name, and frees it. One that a handler is
 * reading at this moment is not freed: the process is about to end. NULL is fine. */
void ov_temporary_end(char *path);

#endif
