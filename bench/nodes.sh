#!/bin/sh
# nodes.sh OVOID MOLECULE [OPTION]...
# A fit shared by two nodes that this machine plays: two network namespaces with host names of their
# own, joined by a cable (a veth pair), a rank of MPI in each, and nothing but TCP between them. As
# root, with Open MPI, iproute2 and bc. Writes CSV: seconds of one process, of two ranks on the one
# node, and of one rank on each, what went over the cable, and whether their models are the same.
set -eu
ovoid=$(realpath "$1")
molecule=$(realpath "$2")
shift 2
near=ovoid-near-$$ far=ovoid-far-$$
work=$(mktemp -d)
trap 'ip netns del $near 2>/dev/null; ip netns del $far 2>/dev/null; rm -rf "$work"' EXIT
trap 'exit 1' INT TERM HUP

ip netns add $near
ip netns add $far
ip link add ovn$$ netns $near type veth peer name ovf$$ netns $far
ip -n $near addr add 10.77.0.1/24 dev ovn$$
ip -n $far addr add 10.77.0.2/24 dev ovf$$
for place in $near $far; do
    ip -n $place link set lo up
done
ip -n $near link set ovn$$ up
ip -n $far link set ovf$$ up

# What ssh is to mpirun: runs a command on the far node.
cat >"$work/agent" <<END
#!/bin/sh
shift
exec ip netns exec $far unshare --uts sh -c 'hostname ovoid-far; exec sh -c "\$0"' "\$*"
END
chmod +x "$work/agent"
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
near() {
    ip netns exec $near unshare --uts sh -c 'hostname ovoid-near; exec "$@"' sh "$@"
}
seconds() { # NAME COMMAND...
    name=$1
    shift
    began=$(date +%s.%N)
    near "$@" fit "$molecule" -o "$work/$name.ovoid" -q --no-measure $options
    echo "$(date +%s.%N) - $began" | bc
}
options=$*
tcp="--mca btl self,tcp --mca btl_tcp_if_include 10.77.0.0/24 --mca oob_tcp_if_include 10.77.0.0/24 --mca pml ob1"
agent="--mca plm_rsh_agent $work/agent"
one=$(seconds one "$ovoid")
same=$(seconds same mpirun --oversubscribe --bind-to none -n 2 "$ovoid")
two=$(seconds two mpirun --bind-to none $tcp $agent -host 10.77.0.1:1,10.77.0.2:1 -n 2 -x OVOID_CACHE_DIR "$ovoid")
cable=$(ip netns exec $far cat /sys/class/net/ovf$$/statistics/tx_bytes /sys/class/net/ovf$$/statistics/rx_bytes | paste -sd+ | bc)
same_model() {
    if cmp -s "$work/one.ovoid" "$work/$1.ovoid"; then echo yes; else echo no; fi
}
echo "ranks,nodes,seconds,bytes_between,same_model"
echo "1,1,$one,0,"
echo "2,1,$same,0,$(same_model same)"
echo "2,2,$two,$cable,$(same_model two)"
