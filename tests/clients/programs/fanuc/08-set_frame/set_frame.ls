/PROG  SET_FRAME
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "panel";
PROG_SIZE	= 612;
CREATE		= DATE 26-11-22  TIME 10:31:04;
LINE_COUNT	= 4;
DEFAULT_GROUP	= 1,*,*,*,*;
/APPL
/MN
   1:  PR[6,1]=1800     ;
   2:  PR[6,2]=(-250)     ;
   3:  PR[6,2]=-250     ;
   4:  PR[6,3]=800     ;
   5:  PR[6,4]=0     ;
   6:  PR[6,5]=0     ;
   7:  PR[6,6]=0     ;
   8:  UFRAME[3]=PR[6]     ;
   9:  UFRAME_NUM=1 ;
  10:  UTOOL_NUM=1 ;
  11:L P[1] 100mm/sec FINE     ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.000  mm,	Z =       .000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
/END
