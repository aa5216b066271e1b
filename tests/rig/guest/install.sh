# Sourced by scripts of the rig's guest: installs the recorder from its package if /rig/atvrec.deb is there,
# else from the files that the package is made of.
if [ -e /rig/atvrec.deb ]; then
    # The index of all manual pages takes minutes here.
    rm -f /var/lib/man-db/auto-update
    dpkg -i /rig/atvrec.deb
    dpkg -L atvrec >/rig/package.list
else
    cp /rig/atvrec /usr/bin/atvrec
    mkdir -p /etc/atvrec /usr/lib/sysusers.d /usr/lib/sysctl.d
    cp /rig/packaging/atvrec.toml /etc/atvrec/
    cp /rig/packaging/*.service /lib/systemd/system/
    cp /rig/packaging/sysusers.conf /usr/lib/sysusers.d/atvrec.conf
    cp /rig/packaging/sysctl.conf /usr/lib/sysctl.d/60-atvrec.conf
    cp /rig/packaging/udev.rules /lib/udev/rules.d/60-atvrec.rules
    sh /rig/packaging/deb/postinst configure
fi
